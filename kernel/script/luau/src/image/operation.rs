//! How operations on images are registered: name, arguments, documentation and work in one table, from which come the
//! methods of a script, the type definitions for editors and the errors about arguments.

use mlua::{IntoLua, Lua, MultiValue, Value};
use pdk_sdk::ops::{Frame, FrameMut};

use super::argument::{Argument, Arguments};
use super::pixels::LuaImage;
use super::workspaces::Workspaces;

/// Something that a script can do with an image.
pub struct Operation {
    /// The name of the method.
    pub name: &'static str,
    /// What it does, in one or more sentences.
    pub doc: &'static str,
    /// What it takes, in this order.
    pub arguments: &'static [Argument],
    /// What it does.
    pub work: Work,
}

/// What an operation does.
pub enum Work {
    /// Writes all pixels, from what they were.
    Change(fn(Frame<'_>, FrameMut<'_>, &mut Arguments<'_>, &mut Workspaces)),
    /// Changes pixels where they are.
    Draw(fn(FrameMut<'_>, &mut Arguments<'_>)),
    /// Makes a new image, as large as the arguments `width` and `height` say, else as this one.
    Make(fn(Frame<'_>, FrameMut<'_>, &mut Arguments<'_>, &mut Workspaces)),
}

impl Operation {
    /// Its type in Luau without `self`.
    pub fn signature(&self) -> String {
        let arguments: Vec<_> =
            self.arguments.iter().map(|a| format!("{}: {}", a.name, a.luau_type())).collect();
        let result = if matches!(self.work, Work::Make(_)) { "Image" } else { "()" };
        format!("({}) -> {result}", arguments.join(", "))
    }

    /// The paragraphs of its documentation: what it does, then each argument.
    pub fn paragraphs(&self) -> Vec<String> {
        let arguments = self.arguments.iter().map(|a| format!("@param {} -- {}", a.name, a.describe()));
        std::iter::once(self.doc.to_owned()).chain(arguments).collect()
    }

    /// What a script calls: checks the arguments and does the work.
    pub(super) fn call(&self, lua: &Lua, mut values: MultiValue) -> mlua::Result<Value> {
        let this = match values.pop_front() {
            Some(Value::UserData(this)) if this.is::<LuaImage>() => this,
            _ => {
                return Err(mlua::Error::runtime(format!(
                    "`{0}` is called with a dot; call it with a colon, as in image:{0}(...)",
                    self.name
                )));
            }
        };
        let call = format!("image:{}", self.name);
        let mut arguments = Arguments::read(&call, self.arguments, &values, &this)?;
        match self.work {
            Work::Draw(draw) => {
                draw(this.borrow_mut::<LuaImage>()?.frame_mut()?, &mut arguments);
                Ok(Value::Nil)
            }
            Work::Change(change) => {
                let mut image = this.borrow_mut::<LuaImage>()?;
                Workspaces::lend(lua, |workspaces| {
                    let mut before = std::mem::take(&mut workspaces.before);
                    before.resize(image.width(), image.height());
                    before.as_mut().copy_from(image.frame()?);
                    change(before.as_ref(), image.frame_mut()?, &mut arguments, workspaces);
                    workspaces.before = before;
                    Ok(Value::Nil)
                })
            }
            Work::Make(make) => {
                let image = this.borrow::<LuaImage>()?;
                let side = |name: &str, own: usize| match self.arguments.iter().any(|a| a.name == name) {
                    true => arguments.given(name).map_or(own, |side| side as usize),
                    false => own,
                };
                let (width, height) = (side("width", image.width()), side("height", image.height()));
                let mut made = LuaImage::of_script(lua, &call, width, height)?;
                Workspaces::lend(lua, |workspaces| {
                    make(image.frame()?, made.frame_mut()?, &mut arguments, workspaces);
                    Ok(())
                })?;
                made.into_lua(lua)
            }
        }
    }
}
