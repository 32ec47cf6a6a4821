//! The programs whose tables are known, each by its own data.

use plychain::field::programs::{FoundUnit, Habit, PROGRAMS, matching};

/// A header of a program's columns, in any order and with a column more, is that program's; its unit is the one of the header, or else of the
/// program's habit.
#[test]
fn every_program_is_told_by_its_columns() {
    let mut labels = Vec::new();
    for program in PROGRAMS {
        for export in program.exports {
            labels.push(export.label);
            let also = export.also.iter().filter(|a| !export.names.contains(a));
            let plain: Vec<String> = also
                .chain(&["elsewhere"])
                .chain(export.names.iter().rev())
                .map(|name| (*name).to_string())
                .collect();
            let found = matching(&plain, None, program.mark.unwrap_or_default());
            let found = found.unwrap_or_else(|| panic!("{}: {plain:?}", export.label));
            assert_eq!(found.label, export.label, "{plain:?}");
            assert_eq!(found.program.mark, program.mark, "{}", export.label);
            assert_eq!(found.columns, export.names, "{}", export.label);
            let usual = match export.unit {
                Habit::Of(unit) => FoundUnit::Usual(unit),
                Habit::Asked => FoundUnit::Unknown,
            };
            assert_eq!(found.units, [usual; 2], "{}", export.label);
            let in_um: Vec<String> = export.names.iter().map(|n| format!("{n} [um]")).collect();
            let also = export.also.iter().map(|name| (*name).to_string());
            let found = matching(&also.chain(in_um).collect::<Vec<_>>(), None, "");
            let found = found.unwrap_or_else(|| panic!("{} in um", export.label));
            assert_eq!(
                found.units,
                [FoundUnit::Stated("um"); 2],
                "{}",
                export.label
            );
        }
    }
    assert!(labels.len() >= PROGRAMS.len(), "{labels:?}");
}
