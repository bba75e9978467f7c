//! The command-line tool `pdk`.

/// Stands in for the standard macro, which panics where nobody reads.
macro_rules! println {
    () => { pdk::output::line(format_args!("")) };
    ($($argument:tt)*) => { pdk::output::line(format_args!($($argument)*)) };
}

/// As above, for standard error.
macro_rules! eprintln {
    ($($argument:tt)*) => { pdk::output::error_line(format_args!($($argument)*)) };
}

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
