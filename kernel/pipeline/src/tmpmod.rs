//! x
#[derive(Clone)] pub struct Modules; impl Modules { pub fn new(_:&std::path::Path,_:Vec<std::path::PathBuf>)->Self{Self} pub fn install(&self,_:&mlua::Lua)->mlua::Result<()>{Ok(())} pub fn loaded(&self)->Vec<pdk_core::manifest::Module>{vec![]} }
