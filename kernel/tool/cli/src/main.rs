//! The command-line tool `pdk`.

mod memory;
mod supervised;
mod verbs;

fn main() -> std::process::ExitCode {
    pdk_supervise::calls::begin();
    pdk_components::product::set(&pdk_product::PRODUCT);
    verbs::main()
}
