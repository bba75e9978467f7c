//! What users meet first: the command line, the documents, the Python package, and an installed copy.

#![allow(clippy::unwrap_used)]

mod cli;
mod commands;
mod documents;
mod domain;
mod english;
mod found;
mod guide;
mod installation;
mod kernel;
mod python;
mod shown;
mod structure;
