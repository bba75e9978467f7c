//! The tables of the report as CSV, Markdown and LaTeX.

use std::fmt::Write as _;

use pdk_report::tables::{Cell, Table};
use pdk_sdk::error::{Place, Result};

/// As CSV, with numbers as they were computed.
///
/// # Errors
/// If it cannot be written.
pub fn csv(table: &Table) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(&table.columns).map_err(std::io::Error::from)?;
    for row in &table.rows {
        let fields = row.iter().map(|cell| match cell {
            Cell::Text(text) => text.clone(),
            Cell::Number { value: Some(value), .. } => value.to_string(),
            Cell::Number { value: None, .. } | Cell::Empty => String::new(),
        });
        writer.write_record(fields).map_err(std::io::Error::from)?;
    }
    writer.into_inner().map_err(|error| error.into_error()).place("cannot write CSV")
}

fn shown(cell: &Cell) -> &str {
    match cell {
        Cell::Empty => "",
        Cell::Text(text) => text,
        Cell::Number { shown, .. } => shown,
    }
}

/// Whether a column holds numbers.
fn is_number(table: &Table, column: usize) -> bool {
    let cells = || table.rows.iter().filter_map(|row| row.get(column));
    cells().any(|cell| matches!(cell, Cell::Number { .. }))
        && !cells().any(|cell| matches!(cell, Cell::Text(_)))
}

/// As Markdown, with its title.
pub fn markdown(table: &Table) -> String {
    let escaped = |text: &str| {
        let text = text.replace('\\', "\\\\").replace('|', "\\|").replace('<', "&lt;");
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let mut text = format!("**{}**\n\n", escaped(&table.title));
    let _ = writeln!(
        text,
        "| {} |",
        table.columns.iter().map(|name| escaped(name)).collect::<Vec<_>>().join(" | ")
    );
    let rule = |column| if is_number(table, column) { "---:" } else { "---" };
    let _ = writeln!(text, "|{}|", (0..table.columns.len()).map(rule).collect::<Vec<_>>().join("|"));
    for row in &table.rows {
        let _ = writeln!(
            text,
            "| {} |",
            row.iter().map(|cell| escaped(shown(cell))).collect::<Vec<_>>().join(" | ")
        );
    }
    text
}

/// As a table of LaTeX with the package booktabs.
pub fn latex(table: &Table) -> String {
    let kind = |column| if is_number(table, column) { 'r' } else { 'l' };
    let columns: String = (0..table.columns.len()).map(kind).collect();
    let line = |cells: Vec<String>| format!("{} \\\\\n", cells.join(" & "));
    let mut text = String::from("% Needs \\usepackage{booktabs}.\n\\begin{table}\n\\centering\n");
    let _ = writeln!(text, "\\caption{{{}}}", escaped(&table.title));
    let _ = writeln!(text, "\\label{{tab:{}}}", table.name);
    let _ = writeln!(text, "\\begin{{tabular}}{{{columns}}}\n\\toprule");
    text += &line(table.columns.iter().map(|name| escaped(name)).collect());
    text += "\\midrule\n";
    for row in &table.rows {
        text += &line(row.iter().map(|cell| escaped(shown(cell))).collect());
    }
    text + "\\bottomrule\n\\end{tabular}\n\\end{table}\n"
}

/// A document with all of these tables, to look at them.
pub fn document<'a>(tables: impl Iterator<Item = &'a Table>) -> String {
    let mut text = String::from(
        "\\documentclass{article}\n\\usepackage[utf8]{inputenc}\n\\usepackage[T1]{fontenc}\n\\usepackage[margin=1cm,landscape]{geometry}\n\\usepackage{booktabs}\n\
         \\begin{document}\n\\footnotesize\n",
    );
    for table in tables {
        let _ = writeln!(text, "\\input{{{}}}\n\\clearpage", table.name);
    }
    text + "\\end{document}\n"
}

/// A text with what LaTeX takes for commands escaped, and marks that its fonts lack written as commands.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for letter in text.chars() {
        match letter {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                escaped.push('\\');
                escaped.push(letter);
            }
            '\\' => escaped += "\\textbackslash{}",
            '~' => escaped += "\\textasciitilde{}",
            '^' => escaped += "\\textasciicircum{}",
            '<' => escaped += "\\textless{}",
            '>' => escaped += "\\textgreater{}",
            '|' => escaped += "\\textbar{}",
            '"' => escaped += "\\textquotedbl{}",
            '\u{2713}' => escaped += "$\\surd$",
            '\u{2717}' => escaped += "$\\times$",
            '\u{25a0}' => escaped += "$\\bullet$",
            '\u{25b7}' => escaped += "$\\triangleright$",
            '\u{2212}' => escaped += "$-$",
            '\u{2013}' => escaped += "--",
            '\u{b7}' => escaped += "$\\cdot$",
            letter if letter.is_control() => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let number = |value: Option<f64>, shown: &str| Cell::Number { value, shown: shown.to_owned() };
        Table {
            name: "failing-levels".into(),
            title: "Level & more".into(),
            columns: vec!["perturbation".into(), "level".into(), "a|b".into()],
            rows: vec![
                vec![Cell::Text("fog_filter".into()), number(Some(1.523), "1.52"), Cell::Empty],
                vec![Cell::Text("rain".into()), number(None, "never"), Cell::Text("50 %".into())],
            ],
        }
    }

    #[test]
    fn csv_has_numbers_as_they_were_computed() {
        let text = String::from_utf8(csv(&table()).unwrap()).unwrap();
        assert_eq!(text, "perturbation,level,a|b\nfog_filter,1.523,\nrain,,50 %\n");
    }

    #[test]
    fn markdown_has_them_as_a_person_reads_them() {
        assert_eq!(
            markdown(&table()),
            "**Level & more**\n\n| perturbation | level | a\\|b |\n|---|---:|---|\n| fog_filter | 1.52 |  |\n| rain | never | 50 % |\n"
        );
    }

    #[test]
    fn latex_takes_no_text_for_a_command() {
        let text = latex(&table());
        assert!(
            text.contains("\\caption{Level \\& more}") && text.contains("\\begin{tabular}{lrl}"),
            "{text}"
        );
        assert!(text.contains("fog\\_filter & 1.52 &  \\\\") && text.contains("50 \\%"), "{text}");
        assert_eq!(
            escaped("a\\b~^<\u{2717}"),
            "a\\textbackslash{}b\\textasciitilde{}\\textasciicircum{}\\textless{}$\\times$"
        );
        assert!(document([table()].iter()).contains("\\input{failing-levels}"));
    }
}
