//! A hundred thousand mangled meshes end in a mesh or in an error; none in a panic, or in memory beyond about the file's size.

use std::process::Command;

use plychain::mesh_files::{ElementKind, raise};

use super::abaqus::strip;
use super::model::{KINDS, rectangle};
use super::round_trips::parse;
use super::sizes::{edge_length, whole_area};
use super::writers::{WRITERS, msh22, msh41};

/// Memory that the readers may have, KiB: the files are a few KiB, the largest below a few MiB.
const MEMORY: u64 = 1 << 16;

/// Mangled files in all.
const FILES: usize = 100_000;

/// Processor time that all of them may take, s: many times what they need.
const PROCESSOR: u64 = 600;

#[test]
fn mangled_meshes_never_panic_hang_or_take_memory_without_bound() {
    // in a process of its own, whose memory and processor time are limited: a reader that asks for more ends it
    let own = std::env::current_exe().unwrap();
    let script = format!(
        "ulimit -d {MEMORY} && ulimit -t {PROCESSOR} && exec \"$0\" imported::mangled::in_bounds --ignored --nocapture --test-threads 1"
    );
    let output = Command::new("sh")
        .args(["-c", &script])
        .arg(&own)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && said.contains("4 passed"),
        "{said}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Xorshift; the same files in every run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % n.max(1)
    }
}

/// Text that words are replaced by.
const WORDS: [&str; 24] = [
    "nan",
    "-inf",
    "1e999",
    "1e308",
    "1e-320",
    "0",
    "-1",
    "1",
    "2",
    "3",
    "4",
    "9",
    "16",
    "4294967296",
    "18446744073709551615",
    "99999999999999999999999",
    "1000000000000",
    "",
    ",",
    "\n",
    "*",
    "$",
    "=",
    "generate",
];

/// Binary numbers that others are replaced by.
const NUMBERS: [u64; 8] = [
    0,
    1,
    2,
    u32::MAX as u64,
    1 << 31,
    1 << 40,
    i64::MAX as u64,
    u64::MAX,
];

fn mangle(bytes: &mut Vec<u8>, dice: &mut Dice) {
    for _ in 0..1 + dice.below(3) {
        let at = dice.below(bytes.len());
        let length = dice.below(40).min(bytes.len() - at);
        match dice.below(9) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..at + length)),
            2 => {
                let copy = bytes[at..at + length].to_vec();
                let to = dice.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            3 if !bytes.is_empty() => bytes[at] = dice.below(256) as u8,
            4 if !bytes.is_empty() => bytes[at] ^= 1 << dice.below(8),
            5 => {
                let number = NUMBERS[dice.below(NUMBERS.len())].to_le_bytes();
                let width = [4, 8][dice.below(2)].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&number[..width]);
            }
            6 => {
                // a digit for another, which leaves the file's structure as it is
                if let Some(digit) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
                    *digit = b'0' + dice.below(10) as u8;
                }
            }
            _ => {
                // a word for another
                let is_end = |b: &u8| b.is_ascii_whitespace() || *b == b',';
                let from = bytes[..at].iter().rposition(is_end).map_or(0, |i| i + 1);
                let to = bytes[at..]
                    .iter()
                    .position(is_end)
                    .map_or(bytes.len(), |i| at + i);
                bytes.splice(from..to.max(from), WORDS[dice.below(WORDS.len())].bytes());
            }
        }
    }
}

/// Parse, and use whatever comes out.
fn survive(name: &str, bytes: &[u8]) -> bool {
    let Ok(mesh) = parse(name, bytes) else {
        return false;
    };
    let raised = raise(mesh);
    assert!(whole_area(&raised) > 0.0 && raised.warnings().len() < 1000);
    for (name, edges) in &raised.edges {
        assert!(!edges.is_empty() && edge_length(&raised, name).unwrap() > 0.0);
    }
    assert!(
        raised
            .regions
            .values()
            .flatten()
            .all(|e| *e < raised.elements.len())
    );
    true
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let mut all: Vec<(&'static str, Vec<u8>)> = Vec::new();
    for (name, write) in WRITERS {
        all.extend(KINDS.map(|kind| (name, write(&rectangle(kind, [2, 2])))));
    }
    let assembled = format!(
        "*Part, name=P\n{}*Nset, nset=low\n1, 6\n*Nset, nset=n, generate\n1, 10, 2\n*Elset, elset=_e, internal, generate\n1, 4\n*End Part\n\
         *Assembly, name=A\n*Instance, name=P-1, part=P\n1., 2., 0.\n*End Instance\n*Elset, elset=f, instance=P-1\n_e, 1\n\
         *Surface, name=s\n_e, S3\n1, S4\n*Surface, type=NODE, name=t\nlow\n*End Assembly\n",
        strip()
    );
    all.push(("part.inp", assembled.into_bytes()));
    all
}

#[test]
#[ignore = "run by the test above in a process of limited memory"]
fn in_bounds_when_mangled() {
    let seeds = seeds();
    let mut dice = Dice(0x9E37_79B9_7F4A_7C15);
    let mut read = 0;
    for k in 0..FILES {
        let (name, seed) = &seeds[k % seeds.len()];
        let mut bytes = seed.clone();
        mangle(&mut bytes, &mut dice);
        read += usize::from(survive(name, &bytes));
    }
    println!("{read} of {FILES} are meshes still");
    assert!(read > FILES / 100 && read < FILES / 2);
}

/// Replace a binary or written count by a huge one, wherever it stands.
#[test]
#[ignore = "run by the test above in a process of limited memory"]
fn in_bounds_with_every_number_huge() {
    let model = rectangle(ElementKind::T3, [1, 1]);
    for bytes in [msh22(&model, true), msh41(&model, true)] {
        for at in 0..bytes.len() - 8 {
            for width in [4, 8] {
                for number in NUMBERS {
                    let mut huge = bytes.clone();
                    huge[at..at + width].copy_from_slice(&number.to_le_bytes()[..width]);
                    survive("plate.msh", &huge);
                }
            }
        }
    }
    for bytes in [msh22(&model, false), msh41(&model, false)] {
        let text = String::from_utf8(bytes).unwrap();
        let words: Vec<&str> = text.split_inclusive(char::is_whitespace).collect();
        for k in 0..words.len() {
            for word in ["1000000000000 ", "18446744073709551615 ", "2147483647\n"] {
                let mut all = words.clone();
                all[k] = word;
                survive("plate.msh", all.concat().as_bytes());
            }
        }
    }
}

/// Short files that would be long ones if every group were written out.
#[test]
#[ignore = "run by the test above in a process of limited memory"]
fn in_bounds_with_thousands_of_groups_of_everything() {
    let many = 20_000;
    let groups: String = (1..=many).map(|g| format!("{g} ")).collect();
    let nodes: String = (0..2 * many).map(|n| format!("{}\n", n + 1)).collect();
    let places: String = (0..2 * many)
        .map(|n| format!("{} {} 0\n", n / 2, n % 2))
        .collect();
    let cells: String = (0..many - 1)
        .map(|e| {
            format!(
                "{} {} {} {} {}\n",
                e + 1,
                2 * e + 1,
                2 * e + 3,
                2 * e + 4,
                2 * e + 2
            )
        })
        .collect();
    let text = format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 0 0 0 {many} {groups}0\n$EndEntities\n\
         $Nodes\n1 {0} 1 {0}\n2 1 0 {0}\n{nodes}{places}$EndNodes\n$Elements\n1 {1} 1 {1}\n2 1 3 {1}\n{cells}$EndElements\n",
        2 * many,
        many - 1
    );
    let error = parse("plate.msh", text.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("at most 100 groups or sets"), "{error}");
}

#[test]
#[ignore = "run by the test above in a process of limited memory"]
fn in_bounds_with_sets_of_sets() {
    let ranges: String = (0..5_000)
        .map(|k| format!("*Nset, nset=s{k}, generate\n1, 1000000000000, 1\n"))
        .collect();
    let nested: String = (1..5_000)
        .map(|k| format!("*Elset, elset=e{k}\ne{}\n", k - 1))
        .collect();
    let first = "*Elset, elset=e0, generate\n1, 9999999999\n";
    let nodes: String = (0..4_000)
        .map(|n| format!("{}, {}., {}.\n", n + 1, n / 2, n % 2))
        .collect();
    let cells: String = (0..1_999)
        .map(|e| {
            format!(
                "{}, {}, {}, {}, {}\n",
                e + 1,
                2 * e + 1,
                2 * e + 3,
                2 * e + 4,
                2 * e + 2
            )
        })
        .collect();
    let mesh = format!("*Node\n{nodes}*Element, type=CPS4\n{cells}");
    assert!(parse("p.inp", format!("{mesh}*Nset, nset=low\n1, 2\n").as_bytes()).is_ok());
    let sparse = "*Nset, nset=a, generate\n1, 1000000000000000, 999\n*Nset, nset=low\n1, 2\n";
    assert!(parse("p.inp", format!("{mesh}{sparse}").as_bytes()).is_ok());
    for sets in [ranges, format!("{first}{nested}")] {
        let error = parse("p.inp", format!("{mesh}{sets}").as_bytes())
            .unwrap_err()
            .to_string();
        assert!(error.contains("at most 100 groups or sets"), "{error}");
    }
}
