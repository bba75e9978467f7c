//! The command-line tool `pdk`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
