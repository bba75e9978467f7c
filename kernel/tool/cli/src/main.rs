//! The command-line tool `pdk`.

mod memory;
mod supervised;
mod verbs;

fn main() -> std::process::ExitCode {
    pdk_supervise::calls::begin();
    verbs::main()
}
