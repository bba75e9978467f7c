//! What users meet first: the command line, the documents, the Python package, and an installed copy.

#![allow(clippy::unwrap_used)]

mod cli;
mod documents;
mod english;
mod guide;
mod found;
mod installation;
mod kernel;
mod python;
mod shown;
