//! What is known of one program: the form of its data.

/// What is known of a program's tables.
#[derive(Debug)]
pub struct Program {
    /// Columns, one set a version or a kind of table.
    pub exports: &'static [ExportColumns],
    /// Words of the lines before its table, in small letters, by which it is told from others.
    pub mark: Option<&'static str>,
    /// Column of a standard deviation or a code of failure, negative where the correlation failed, that is in pixels whatever the
    /// displacements' unit; the first that is there.
    pub sigma_in_pixels: &'static [&'static str],
    /// Whether y counts downwards in the picture.
    pub y_downwards: bool,
    /// Words before the side of a subset, the step of the grid (both in pixels) and the picture in the lines before the table.
    pub subset_px: Option<&'static str>,
    pub step_px: Option<&'static str>,
    pub picture: Option<&'static str>,
    /// Columns of the coefficient of the correlation, in small letters, without their units.
    pub correlation: &'static [&'static str],
    /// Columns that mark points; which values mark a failed one, they do not say.
    pub marks: &'static [&'static str],
    /// How to get a table of text, where the program also writes files of bytes.
    pub as_text: Option<&'static str>,
}

/// A program of which only the columns are known.
pub const COLUMNS_ONLY: Program = Program {
    exports: &[],
    mark: None,
    sigma_in_pixels: &[],
    y_downwards: false,
    subset_px: None,
    step_px: None,
    picture: None,
    correlation: &[],
    marks: &[],
    as_text: None,
};

/// Columns of one kind of table.
#[derive(Debug)]
pub struct ExportColumns {
    /// The program, as `init` names it.
    pub label: &'static str,
    /// Names of x, y, ux, uy without units.
    pub names: [&'static str; 4],
    /// The unit where the file states none.
    pub unit: Habit,
    /// Names of the coordinate and the displacement out of the plane of the picture, where the program writes them.
    pub out_of_plane: [&'static str; 2],
    /// Other columns that tell this table from another program's with the same names.
    pub also: &'static [&'static str],
    /// Whether small letters are another quantity.
    pub capitals_matter: bool,
    /// Whether x and y are places in the deformed state.
    pub deformed: bool,
}

/// The unit of a table that states none.
#[derive(Debug, Clone, Copy)]
pub enum Habit {
    /// The program writes it always, if the user has not changed that.
    Of(&'static str),
    /// Nobody knows.
    Asked,
}

/// A set of columns in which nothing but the names is peculiar.
pub const fn columns(label: &'static str, names: [&'static str; 4], unit: Habit) -> ExportColumns {
    ExportColumns {
        label,
        names,
        unit,
        out_of_plane: [""; 2],
        also: &[],
        capitals_matter: false,
        deformed: false,
    }
}

/// The same of a stereo measurement, with the names of the coordinate and the displacement out of the plane.
pub const fn stereo(
    label: &'static str,
    names: [&'static str; 4],
    unit: Habit,
    out_of_plane: [&'static str; 2],
) -> ExportColumns {
    ExportColumns {
        out_of_plane,
        ..columns(label, names, unit)
    }
}
