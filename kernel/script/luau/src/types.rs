//! The type definition file for editors, written from the tables that register the API.

use crate::api::{ApiClass, ApiRecord, ApiTable};

/// Something that has a place in the type definition file.
pub trait Declare {
    /// Its definition, with its documentation as comments, ending in a line break.
    fn declare(&self) -> String;
}

impl<T> ApiClass<T> {
    /// Its definition with further methods: a name, a type without `self`, and the paragraphs of the documentation.
    pub fn declare_with(&self, more: impl Iterator<Item = (&'static str, String, Vec<String>)>) -> String {
        let mut text = comment(self.doc, "");
        text += &format!("declare extern type {} with\n", self.name);
        for property in self.properties {
            text += &comment(property.doc, INDENT);
            text += &format!("{INDENT}{}: {}\n", property.name, property.luau_type);
        }
        let methods = self.methods.iter().map(|m| (m.name, m.signature.to_owned(), vec![m.doc.to_owned()]));
        for (name, signature, paragraphs) in methods.chain(more) {
            paragraphs.iter().for_each(|paragraph| text += &comment(paragraph, INDENT));
            text += &format!("{INDENT}function {name}{}\n", with_self(&signature));
        }
        text + "end\n"
    }
}

impl<T> Declare for ApiClass<T> {
    fn declare(&self) -> String {
        self.declare_with(std::iter::empty())
    }
}

impl Declare for ApiRecord {
    fn declare(&self) -> String {
        let mut text = comment(self.doc, "");
        text += &format!("export type {} = {{\n", self.name);
        for field in self.fields {
            text += &comment(field.doc, INDENT);
            text += &format!("{INDENT}{}: {},\n", key(field.name), field.luau_type);
        }
        text + "}\n"
    }
}

/// The name of a field as a key: one that is a word of the language stands in brackets.
fn key(name: &str) -> String {
    const WORDS: [&str; 21] = [
        "and", "break", "do", "else", "elseif", "end", "false", "for", "function", "if", "in", "local",
        "nil", "not", "or", "repeat", "return", "then", "true", "until", "while",
    ];
    if WORDS.contains(&name) { format!("[\"{name}\"]") } else { name.to_owned() }
}

impl Declare for ApiTable {
    fn declare(&self) -> String {
        let mut text = comment(self.doc, "");
        text += &format!("declare {}: {{\n", self.name);
        for function in self.functions {
            text += &comment(function.doc, INDENT);
            text += &format!("{INDENT}{}: {},\n", function.name, function.signature);
        }
        text + "}\n"
    }
}

/// The type definition file.
pub fn definitions(api: &[&dyn Declare]) -> String {
    let mut text = String::from(
        "-- Types for editors, such as luau-lsp. Written from the registration of the API; changes here are lost.\n",
    );
    for item in api {
        text.push('\n');
        text += &item.declare();
    }
    text
}

const INDENT: &str = "    ";

/// `(sigma: number) -> ()` as `(self, sigma: number): ()`.
fn with_self(signature: &str) -> String {
    let (arguments, result) = signature.rsplit_once(" -> ").unwrap_or((signature, "()"));
    match arguments.strip_prefix('(') {
        Some(")") => format!("(self): {result}"),
        Some(rest) => format!("(self, {rest}: {result}"),
        None => format!("{arguments}: {result}"),
    }
}

/// A documentation comment, wrapped.
fn comment(text: &str, indent: &str) -> String {
    const WIDTH: usize = 110;
    let mut lines = String::new();
    let mut line = format!("{indent}---");
    for word in text.split_whitespace() {
        if line.len() + 1 + word.len() > WIDTH {
            lines.push_str(&line);
            lines.push('\n');
            line = format!("{indent}---");
        }
        line.push(' ');
        line.push_str(word);
    }
    lines + &line + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::ApiFunction;
    use crate::limits::Limits;
    use crate::sandbox::Sandbox;

    #[test]
    fn signatures_get_self() {
        assert_eq!(with_self("() -> ()"), "(self): ()");
        assert_eq!(with_self("(sigma: number) -> Image"), "(self, sigma: number): Image");
        assert_eq!(
            with_self("(f: (x: number) -> number) -> Image"),
            "(self, f: (x: number) -> number): Image"
        );
    }

    #[test]
    fn a_table_is_installed_and_declared_from_the_same_list() {
        const TABLE: ApiTable = ApiTable {
            name: "greet",
            doc: "Greets.",
            functions: &[ApiFunction {
                name: "hello",
                signature: "(name: string) -> string",
                doc: "Says hello.",
                make: |lua| lua.create_function(|_, name: String| Ok(format!("hello {name}"))),
            }],
        };
        let sandbox = Sandbox::with_api(Limits::default(), |lua| TABLE.install(lua)).unwrap();
        let chunk = sandbox.load("s.lua", b"return greet.hello('road')").unwrap();
        assert_eq!(sandbox.call("s.lua", &chunk, ()).unwrap().to_string().unwrap(), "hello road");
        let change = sandbox.load("s.lua", b"greet.hello = nil").unwrap();
        assert!(sandbox.call("s.lua", &change, ()).is_err());
        assert_eq!(
            TABLE.declare(),
            "--- Greets.\ndeclare greet: {\n    --- Says hello.\n    hello: (name: string) -> string,\n}\n"
        );
    }
}
