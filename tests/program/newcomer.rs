//! What someone new to the program meets: init, help, and the README's commands.

use crate::common::{copy, program, root};
use crate::common::{json, read};
use crate::report::run;

#[test]
fn init_writes_a_model_that_runs_and_never_overwrites() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("export.csv");
    let mut text = String::from(
        "coor.X [mm];coor.Y [mm];disp.Horizontal Displacement U [mm];disp.Vertical Displacement V [mm]\n",
    );
    for k in 0..60 * 30 {
        let (x, y) = (1.0 + 0.5 * f64::from(k % 60), 2.0 + 0.5 * f64::from(k / 60));
        if (x - 16.0).hypot(y - 9.0) > 3.0 {
            text += &format!("{x};{y};{};{}\n", -2e-4 * x, 7e-4 * y);
        }
    }
    std::fs::write(&csv, text).unwrap();
    let here = |arguments: &[&str]| {
        let mut command = program();
        command
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap()
    };
    let output = here(&["init", "strip", "--like", "steel", "--csv", "export.csv"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(
        said.contains("MatchID") && said.contains("load.force_N"),
        "{said}"
    );
    let written = json(&folder.path().join("strip.json"));
    let measurement = &written["experiments"][0]["measurement"];
    assert_eq!(measurement["loading_axis"], "y");
    assert_eq!(
        measurement["columns"]["ux"],
        "disp.Horizontal Displacement U [mm]"
    );
    for (k, known) in [16.0, 9.0].iter().enumerate() {
        let centre = measurement["hole_center_in_data_mm"][k].as_f64().unwrap();
        assert!((centre - known).abs() < 0.1, "{centre}");
    }
    let diameter = written["experiments"][0]["specimen"]["hole"]["diameter_mm"]
        .as_f64()
        .unwrap();
    // to half a spacing, which is 0.5 mm
    assert!((5.75..6.25).contains(&diameter), "{diameter}");
    let again = here(&["init", "strip"]);
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("strip.json"));
    assert_eq!(json(&folder.path().join("strip.json")), written);
    // every shipped model is embedded
    for like in ["openhole", "steel"] {
        assert!(here(&["init", like, "--like", like]).status.success());
    }
    std::fs::write(folder.path().join("odd.csv"), "a,b,c,d\n1,2,3,4\n").unwrap();
    let odd = here(&["init", "odd", "--csv", "odd.csv"]);
    let errors = String::from_utf8_lossy(&odd.stderr).into_owned();
    assert!(
        errors.contains("odd.csv") && errors.contains("VIC-2D") && errors.contains("a, b, c, d"),
        "{errors}"
    );
    // what the table does not say is left open, and refused by name
    assert!(read(&folder.path().join("odd.json")).contains("\"?\""));
    let open = here(&["loop", "odd.json"]);
    let errors = String::from_utf8_lossy(&open.stderr).into_owned();
    assert_eq!(open.status.code(), Some(1), "{errors}");
    assert!(
        errors.contains("odd.json") && errors.contains("`?`"),
        "{errors}"
    );
}

/// Export templates differ in their units: the header states them, one for the coordinates and one for the displacements.
#[test]
fn init_takes_the_units_from_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let try_header = |name: &str, header: &str| {
        let csv = folder.path().join(format!("{name}.csv"));
        let mut text = format!("{header}\n");
        for k in 0..400 {
            let (x, y) = (k % 20, k / 20);
            let cells = header.split(';').count();
            let pair = [0.1 * f64::from(x), 0.1 * f64::from(y)];
            let others = (2..cells).map(|c| format!(";{}", pair[c % 2]));
            text += &format!("{x};{y}{}\n", others.collect::<String>());
        }
        std::fs::write(&csv, text).unwrap();
        let mut command = program();
        let init = ["init", name, "--csv", csv.to_str().unwrap()];
        let output = command.current_dir(folder.path()).args(init).output();
        let output = output.unwrap();
        match output.status.success() {
            true => Ok(
                json(&folder.path().join(format!("{name}.json")))["experiments"][0]["measurement"]
                    .clone(),
            ),
            false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        }
    };
    for (name, header, x, ux, [coordinates, displacements]) in [
        (
            "match",
            "Coor.X [Pixel];Coor.Y [Pixel];Coor.X [mm];Coor.Y [mm];Disp.Horizontal Displacement U [Pixel];Disp.Vertical Displacement V [Pixel];Disp.Horizontal Displacement U [\u{b5}m];Disp.Vertical Displacement V [\u{b5}m]",
            "Coor.X [mm]",
            "Disp.Horizontal Displacement U [\u{b5}m]",
            ["mm", "um"],
        ),
        (
            "vic",
            "X (m);Y (m);U (um);V (um)",
            "X (m)",
            "U (um)",
            ["m", "um"],
        ),
        ("plain", "x_in;y_in;u_um;v_um", "x_in", "u_um", ["in", "um"]),
        ("bare", "X;Y;U;V", "X", "U", ["mm", "mm"]),
    ] {
        let measurement = try_header(name, header).unwrap();
        assert_eq!(measurement["columns"]["x"], x, "{header}");
        assert_eq!(measurement["columns"]["ux"], ux, "{header}");
        assert_eq!(measurement["units"]["coordinates"], coordinates, "{header}");
        assert_eq!(
            measurement["units"]["displacements"], displacements,
            "{header}"
        );
    }
    for (name, header) in [
        ("pixels", "x [px];y [px];u [px];v [px]"),
        ("half", "X [mm];Y [mm];U [pixel];V [pixel]"),
    ] {
        let error = try_header(name, header).unwrap_err();
        assert!(
            error.contains("pixels") && error.contains("calibration"),
            "{error}"
        );
    }
    for (name, header) in [
        ("mixed", "X [mm];Y [m];U [mm];V [mm]"),
        ("partly", "X (m);Y (m);U;V"),
        ("unsaid", "x;y;ux;uy"),
    ] {
        let error = try_header(name, header).unwrap_err();
        assert!(error.contains("measurement.columns"), "{error}");
    }
}

/// Commands of the blocks of shell in README.md and the two manuals, without `plychain`.
fn readmes_commands() -> Vec<Vec<String>> {
    let readme = ["README.md", "models/README.md", "runs/README.md"]
        .map(|name| read(&root().join(name)))
        .concat();
    let mut blocks = readme.split("```");
    let mut commands = Vec::new();
    while let (Some(_), Some(block)) = (blocks.next(), blocks.next()) {
        let Some(lines) = block.strip_prefix("sh\n") else {
            continue;
        };
        for line in lines.lines() {
            let line = line.split(" #").next().unwrap().trim();
            let words: Vec<String> = line.split_whitespace().map(String::from).collect();
            if words.first().is_some_and(|w| w == "plychain") {
                commands.push(words[1..].to_vec());
            }
        }
    }
    commands
}

#[test]
fn the_readmes_commands_are_understood_and_the_quick_ones_work() {
    let commands = readmes_commands();
    assert!(commands.len() >= 5, "{commands:?}");
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    copy(&root().join("models"), &at("models"));
    std::fs::create_dir_all(at("runs")).unwrap();
    copy(run(), &at("runs/openhole"));
    copy(run(), &at("runs/specimen"));
    let mut csv = String::from("X,Y,Z,U,V,W\n");
    for k in 0..40 * 20 {
        let (x, y) = (f64::from(k % 40), f64::from(k / 40));
        if (x - 20.0).hypot(y - 10.0) > 4.0 {
            csv += &format!("{x},{y},0,{},{},0\n", 5e-4 * x, -2e-4 * y);
        }
    }
    // every export that the pages name
    for (option, name) in commands.iter().flat_map(|c| c.iter().zip(c.iter().skip(1))) {
        if option == "--csv" && !name.contains('*') {
            std::fs::write(at(name), &csv).unwrap();
        }
    }
    let quick = ["init", "report", "export", "diagnose", "effects"];
    let mut worked = 0;
    for command in &commands {
        let mut program = program();
        program.current_dir(folder.path()).args(command);
        // a series is written and proposed by a test of its own
        let for_a_shell = |w: &String| w == ">" || w == "|" || w.contains('*');
        if quick.contains(&command[0].as_str()) && !command.iter().any(for_a_shell) {
            let output = program.output().unwrap();
            assert!(
                output.status.success(),
                "{command:?}\n{}",
                String::from_utf8_lossy(&output.stderr)
            );
            worked += 1;
        } else {
            // what takes longer is run by the tests of its verb; here its arguments are understood
            let output = program.arg("--help").output().unwrap();
            assert!(output.status.success(), "{command:?}");
        }
    }
    assert!(worked >= 4, "only {worked} were run");
}

#[test]
fn colours_are_for_terminals_and_respect_no_color() {
    let said = |colour: &[(&str, &str)]| {
        let mut command = program();
        command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE");
        command.envs(colour.iter().copied());
        let output = command.args(["report", "nowhere"]).output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(said(&[]).starts_with("error: "), "a pipe gets no colours");
    let forced = said(&[("CLICOLOR_FORCE", "1")]);
    assert!(
        forced.starts_with('\u{1b}') && forced.contains("error:"),
        "{forced:?}"
    );
    let refused = said(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]);
    assert!(!refused.contains('\u{1b}'), "{refused:?}");
}

/// The files below a folder, by their paths in it.
fn files_in(folder: &std::path::Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut todo = vec![folder.to_path_buf()];
    while let Some(next) = todo.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => todo.push(path),
                false => found.push(path.strip_prefix(folder).unwrap().display().to_string()),
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_example_is_in_the_program_as_the_repository_has_it() {
    let models = root().join("models");
    let names = std::fs::read_dir(&models).unwrap().filter_map(|entry| {
        let name = entry.unwrap().file_name().into_string().unwrap();
        name.strip_suffix(".json").map(String::from)
    });
    let names: Vec<String> = names.collect();
    assert!(names.len() >= 9, "{names:?}");
    for name in &names {
        let folder = tempfile::tempdir().unwrap();
        let write = || {
            let mut command = program();
            command
                .current_dir(folder.path())
                .args(["init", "--example", name])
                .output()
                .unwrap()
        };
        let output = write();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            output.status.success(),
            "{name}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        for file in files_in(folder.path()) {
            let [there, here] = [&models, folder.path()]
                .map(|f: &std::path::Path| std::fs::read(f.join(&file)).unwrap());
            assert_eq!(there, here, "{file}");
            assert!(said.contains(&file), "{file} is not named: {said}");
        }
        // twice the same is no harm; a file of one's own is
        assert!(write().status.success());
        std::fs::write(folder.path().join(format!("{name}.json")), "{}").unwrap();
        let refused = write();
        assert_eq!(refused.status.code(), Some(1));
        assert!(String::from_utf8_lossy(&refused.stderr).contains("existing"));
    }
    let mut command = program();
    let unknown = command
        .args(["init", "--example", "nothing"])
        .output()
        .unwrap();
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("two-holes"));
}

/// `plychain build` stands for every verb that reads the default model; `loop` does the same, and takes longer.
#[test]
fn the_default_model_works_in_an_empty_folder() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = program();
        command
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap()
    };
    let simulated = run(&["simulate", "--grid", "21", "--out", "simulated"]);
    assert!(
        simulated.status.success(),
        "{}",
        String::from_utf8_lossy(&simulated.stderr)
    );
    assert!(String::from_utf8_lossy(&simulated.stderr).contains("comes with the program"));
    assert!(folder.path().join("models/openhole.json").is_file());
    assert!(folder.path().join("simulated/model.json").is_file());
    // the second time it is there
    let again = run(&["design-of-experiments", "--out", "doe.csv"]);
    assert!(again.status.success());
    assert!(String::from_utf8_lossy(&again.stderr).is_empty());
    // a verb without the default model leaves nothing
    let other = tempfile::tempdir().unwrap();
    let mut command = program();
    command
        .current_dir(other.path())
        .arg("effects")
        .output()
        .unwrap();
    assert!(files_in(other.path()).is_empty());
}

#[test]
fn help_prints_commands_and_sections_of_the_manuals() {
    use crate::common::{plychain, succeed};

    for (topic, file) in [("models", "models/README.md"), ("runs", "runs/README.md")] {
        assert_eq!(succeed(&["help", topic]), read(&root().join(file)));
    }
    let series = succeed(&["help", "load", "series"]);
    assert!(series.starts_with("## Load series"), "{series}");
    assert!(
        series.contains("**law**") && !series.contains("## Fringe pictures"),
        "{series}"
    );
    assert_eq!(
        succeed(&["help", "campaign", "collect"]),
        succeed(&["campaign", "collect", "--help"])
    );
    assert!(succeed(&["help"]).contains("Campaigns"));
    let unknown = plychain(&["help", "nonsense"]);
    assert_eq!(unknown.status.code(), Some(1));
    // every heading of the manuals is a topic
    for file in ["models/README.md", "runs/README.md"] {
        let text = read(&root().join(file));
        for heading in text
            .split("```")
            .step_by(2)
            .flat_map(str::lines)
            .filter_map(|l| l.strip_prefix("## "))
        {
            let plain: Vec<&str> = heading.split_whitespace().collect();
            let shown = succeed(&[&["help"], &plain[..]].concat());
            assert!(shown.contains(heading), "{heading}");
        }
    }
}

/// `identify` of the model that a loop wrote has the constants of its last round, within Monte Carlo error.
#[test]
#[ignore = "length: four loops, 4 minutes"]
fn what_a_loop_writes_is_what_it_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let here = |arguments: &[&str]| {
        let mut command = program();
        let output = command
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {said}");
    };
    for example in ["openhole", "oblique", "two-holes", "disc"] {
        here(&["init", "--example", example]);
        let out = format!("{example}-loop");
        let again = format!("{example}-again");
        here(&["loop", &format!("{example}.json"), "--quiet", "--out", &out]);
        let written = format!("{out}/model.extended.json");
        here(&["identify", &written, "--quiet", "--out", &again]);
        let [fitted, found] = [&out, &again].map(|run| {
            let report = json(&folder.path().join(run).join("report.json"));
            report["rounds"].as_array().unwrap().last().unwrap()["posterior"].clone()
        });
        for name in ["E1_GPa", "E2_GPa", "nu12", "G12_GPa"] {
            let of = |key: &str| [&fitted, &found].map(|p| p[name][key].as_f64().unwrap());
            let ([a, b], [first, second]) = (of("mean"), of("mcse_mean"));
            let error = first.hypot(second);
            assert!(
                (a - b).abs() < 4.0 * error,
                "{example}, {name}: {a} {b} +- {error}"
            );
        }
    }
}
