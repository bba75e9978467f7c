//! How functions and classes are registered and documented.
//!
//! What a script can use is listed once, in tables of these types. The same tables install it in a virtual machine and
//! write the type definitions for editors ([`crate::types`]), so the two cannot differ.

use mlua::{Function, Lua, UserDataRegistry};

use crate::unknown::{refuse_unknown, strict};

/// A function in a global table.
pub struct ApiFunction {
    /// Its name in the table.
    pub name: &'static str,
    /// Its type in Luau: `(path: string, level: number?) -> Image`.
    pub signature: &'static str,
    /// What it does, in one or more sentences.
    pub doc: &'static str,
    /// Makes it. What it needs to know of the host it finds in `Lua::app_data_ref`.
    pub make: fn(&Lua) -> mlua::Result<Function>,
}

/// A global table of functions.
pub struct ApiTable {
    /// The name of the global.
    pub name: &'static str,
    /// What it is for.
    pub doc: &'static str,
    /// What is in it.
    pub functions: &'static [ApiFunction],
}

impl ApiTable {
    /// Makes the table and sets the global.
    ///
    /// # Errors
    /// If the virtual machine is out of memory.
    pub fn install(&self, lua: &Lua) -> mlua::Result<()> {
        let table = lua.create_table()?;
        for function in self.functions {
            table.raw_set(function.name, (function.make)(lua)?)?;
        }
        let known = self.functions.iter().map(|function| function.name.to_owned()).collect();
        table.set_metatable(Some(strict(lua, self.name, "function", known)?))?;
        lua.globals().set(self.name, table)
    }
}

/// A method of a class.
pub struct ApiMethod<T: 'static> {
    /// Its name.
    pub name: &'static str,
    /// Its type in Luau without `self`: `(sigma: number) -> ()`.
    pub signature: &'static str,
    /// What it does, in one or more sentences.
    pub doc: &'static str,
    /// Adds it to the class under the given name.
    pub add: fn(&mut UserDataRegistry<T>, &'static str),
}

/// A value of an object that can be read.
pub struct ApiProperty<T: 'static> {
    /// Its name.
    pub name: &'static str,
    /// Its type in Luau.
    pub luau_type: &'static str,
    /// What it is, with its unit.
    pub doc: &'static str,
    /// Adds it to the class under the given name.
    pub add: fn(&mut UserDataRegistry<T>, &'static str),
}

/// A class of objects that the host makes.
pub struct ApiClass<T: 'static> {
    /// The name of the type.
    pub name: &'static str,
    /// What it is for.
    pub doc: &'static str,
    /// Its values.
    pub properties: &'static [ApiProperty<T>],
    /// Its methods.
    pub methods: &'static [ApiMethod<T>],
}

impl<T: 'static> ApiClass<T> {
    /// Adds all that is listed; the whole of `UserData::register`.
    pub fn register(&self, registry: &mut UserDataRegistry<T>) {
        for property in self.properties {
            (property.add)(registry, property.name);
        }
        for method in self.methods {
            (method.add)(registry, method.name);
        }
    }

    /// Refuses methods that are not listed, with what was probably meant. It takes the methods of a class without values a little longer.
    pub fn refuse_unknown(&self, registry: &mut UserDataRegistry<T>, owner: &'static str) {
        let values = self.properties.iter().map(|property| property.name);
        let known = values.chain(self.methods.iter().map(|method| method.name)).map(str::to_owned).collect();
        refuse_unknown(registry, owner, known);
    }
}

/// A field of a table that a script writes or reads; `[string]` stands for fields of any name.
pub type ApiField = pdk_model::described::Field;

/// A table with a fixed set of fields: one that a script returns, or one that it is given.
pub struct ApiRecord {
    /// The name of the type.
    pub name: &'static str,
    /// What it is for.
    pub doc: &'static str,
    /// Its fields.
    pub fields: &'static [ApiField],
}

impl ApiRecord {
    /// The names of the fields, without that of an indexer such as `[string]`.
    pub fn names(&self) -> impl Iterator<Item = &'static str> + Clone {
        self.fields.iter().map(|field| field.name).filter(|name| !name.starts_with('['))
    }
}
