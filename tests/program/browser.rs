//! The report in a browser: no complaint, nothing too wide, maps and tables there.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::read;
use crate::common::succeed;
use crate::report::{changed, looped, run};

/// The browser that `PLYCHAIN_CHROMIUM` names, or the one on the path.
fn browser() -> PathBuf {
    if let Ok(path) = std::env::var("PLYCHAIN_CHROMIUM") {
        return path.into();
    }
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let path = std::env::var_os("PATH").unwrap();
    std::env::split_paths(&path)
        .flat_map(|dir| names.map(|n| dir.join(n)))
        .find(|p| p.is_file())
        .expect("Chromium is on the path, or PLYCHAIN_CHROMIUM names one")
}

/// What a browser makes of a page in a frame of some width: (scroll width, maps shown, tables shown), and the console's errors.
fn shown(chromium: &Path, html: &str, width: u32) -> ([u64; 3], String) {
    let quoted = html.replace('&', "&amp;").replace('"', "&quot;");
    let page = format!(
        "<!DOCTYPE html><body><iframe id=f width={width} height=900 style=\"border:0\" srcdoc=\"{quoted}\"></iframe>\
         <script>window.onload = () => setTimeout(() => {{ const d = document.getElementById('f').contentDocument; \
         d.querySelectorAll('details').forEach((e) => e.open = true); \
         const big = (s) => [...d.querySelectorAll(s)].filter((e) => e.getBoundingClientRect().width > 50).length; \
         document.body.innerHTML = '[' + [d.documentElement.scrollWidth, big('image.map'), big('table')] + ']'; }}, 300);</script>"
    );
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("frame.html");
    std::fs::write(&path, page).unwrap();
    let output = Command::new(chromium)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--enable-logging=stderr",
        ])
        .args([
            "--window-size=1400,1000",
            "--virtual-time-budget=4000",
            "--dump-dom",
        ])
        .arg(format!(
            "--user-data-dir={}",
            place.path().join("profile").display()
        ))
        .arg(format!("file://{}", path.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    let console: Vec<&str> = errors.lines().filter(|l| l.contains(":CONSOLE")).collect();
    let counts = dom
        .split_once('[')
        .and_then(|(_, rest)| rest.split_once(']'))
        .map(|(list, _)| {
            list.split(',')
                .map(|n| n.parse().unwrap())
                .collect::<Vec<u64>>()
        })
        .unwrap_or_else(|| {
            panic!(
                "the page did not answer: {}\n{errors}",
                &dom[..dom.len().min(400)]
            )
        });
    ([counts[0], counts[1], counts[2]], console.join("\n"))
}

#[test]
#[ignore = "needs Chromium"]
fn a_browser_shows_the_report_without_complaint_at_both_widths() {
    let chromium = browser();
    let folder = changed(looped);
    succeed(&["report", &folder.display().to_string()]);
    for html in [
        read(&run().join("report.html")),
        read(&folder.join("report.html")),
    ] {
        for width in [400, 1280] {
            let ([scroll, maps, tables], console) = shown(&chromium, &html, width);
            assert_eq!(console, "", "at {width} px");
            assert!(scroll <= u64::from(width), "{scroll} px wide at {width} px");
            assert!(
                maps >= 6 && tables >= 6,
                "{maps} maps and {tables} tables at {width} px"
            );
        }
    }
    // the probe sees what it is there to see
    let wide = "<!DOCTYPE html><div style=\"width:2000px\">x</div><script>console.error('seen'); fetch('https://example.invalid/')</script>";
    let ([scroll, ..], console) = shown(&chromium, wide, 400);
    assert!(
        scroll >= 2000 && console.contains("seen"),
        "{scroll} {console}"
    );
}
