//! Tables in Markdown: a measure each, with a row for each problem and a column for each strategy.

use pdk_statistics::independent::compare;

use crate::regions::MEASURES;

/// The searches of a strategy on a problem.
pub struct Cell {
    pub problem: &'static str,
    pub about: &'static str,
    pub numbers: &'static str,
    pub strategy: &'static str,
    /// The measures of each search.
    pub searches: Vec<[f64; 4]>,
}

/// A difference counts where a table's tests together err with this probability at most.
const ERROR: f64 = 0.05;

/// Prints the tables. A mean is bold if it is better than that of random search, and in italics if it is worse, by the
/// test of Mann and Whitney and Holm's correction for all comparisons of the table.
pub fn tables(cells: &[Cell]) {
    let mut strategies: Vec<&str> = Vec::new();
    let mut rows: Vec<(&str, &str)> = Vec::new();
    for cell in cells {
        if !strategies.contains(&cell.strategy) {
            strategies.push(cell.strategy);
        }
        if !rows.contains(&(cell.problem, cell.numbers)) {
            println!("{}- `{}`: {}", if rows.is_empty() { "\n" } else { "" }, cell.problem, cell.about);
            rows.push((cell.problem, cell.numbers));
        }
    }
    let find = |row: (&str, &str), strategy: &str| {
        cells.iter().find(|cell| (cell.problem, cell.numbers) == row && cell.strategy == strategy)
    };
    for (measure, title) in MEASURES.iter().enumerate() {
        let values = |cell: &Cell| cell.searches.iter().map(|all| all[measure]).collect::<Vec<f64>>();
        let compared: Vec<Vec<(f64, f64)>> = rows
            .iter()
            .map(|&row| {
                let chance = find(row, "random").map(values).unwrap_or_default();
                let against =
                    |strategy: &&str| against(&find(row, strategy).map(values).unwrap_or_default(), &chance);
                strategies.iter().map(against).collect()
            })
            .collect();
        let mut tests: Vec<f64> = compared
            .iter()
            .flat_map(|row| row.iter().zip(&strategies).filter(|(_, strategy)| **strategy != "random"))
            .map(|((_, p), _)| *p)
            .collect();
        let largest = holm(&mut tests);
        println!(
            "\n{title}\n\n| problem | numbers | {} |",
            strategies.iter().map(|s| format!("`{s}`")).collect::<Vec<_>>().join(" | ")
        );
        println!("|---|---|{}", "---|".repeat(strategies.len()));
        for (&row, compared) in rows.iter().zip(&compared) {
            let mut line = format!("| `{}` | {} |", row.0, row.1);
            for (strategy, &(effect, p)) in strategies.iter().zip(compared) {
                let values = find(row, strategy).map(values).unwrap_or_default();
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                let mean = if measure < 2 { format!("{mean:.2}") } else { format!("{mean:.0}") };
                let mark = mark(effect, p, largest);
                line += &format!(" {mark}{mean}{mark} |");
            }
            println!("{line}");
        }
    }
}

/// The probability that a value is larger than one of random search, and the p of the test that they do not differ.
pub fn against(values: &[f64], chance: &[f64]) -> (f64, f64) {
    compare(values, chance).map_or((0.5, 1.0), |compared| (compared.effect_size, compared.p))
}

/// The mark of a cell: bold if it is better than random search, with this probability, and in italics if it is worse.
pub fn mark(better: f64, p: f64, largest: f64) -> &'static str {
    match p <= largest {
        true if better > 0.5 => "**",
        true if better < 0.5 => "*",
        _ => "",
    }
}

/// The largest p that counts by the procedure of Holm (1979); below 0 if none does.
pub fn holm(tests: &mut [f64]) -> f64 {
    tests.sort_by(f64::total_cmp);
    let count = tests.len();
    let counts = tests.iter().enumerate().take_while(|(place, p)| **p <= ERROR / (count - place) as f64);
    counts.last().map_or(-1.0, |(_, p)| *p)
}
