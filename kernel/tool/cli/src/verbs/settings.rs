//! What is set for a run on the command line: `--set` for the settings of its pipeline and of every run, and a flag for each of the latter.

use std::ffi::OsString;

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Arg, ArgAction, ArgMatches, Command};
use pdk_pipeline::follow::Audience;
use pdk_pipeline::run::Options;
use pdk_pipeline::run_settings::{RUN_SETTINGS, Setting};
use pdk_pipeline::settings::{Override, split};
use pdk_sdk::error::Result;

use super::Global;

const SET: &str = "set";

/// What is set for any pipeline.
pub struct Settings {
    overrides: Vec<Override>,
    flags: Vec<(&'static Setting, OsString)>,
}

impl Settings {
    /// How a pipeline is run with these settings. A flag counts more than `--set`.
    ///
    /// # Errors
    /// If a setting cannot have its value.
    pub fn options(&self, global: &Global, audience: Audience) -> Result<Options> {
        let (mut common, settings) = split(self.overrides.clone())?;
        for (setting, value) in &self.flags {
            common.set(setting, value)?;
        }
        Ok(Options { common, settings, search: global.search_path(), audience })
    }
}

impl clap::Args for Settings {
    fn augment_args(command: Command) -> Command {
        let set = Arg::new(SET)
            .long(SET)
            .value_name("KEY=VALUE")
            .help("Put a value in the place of a setting's default; dots lead into tables")
            .action(ArgAction::Append)
            .value_parser(clap::value_parser!(Override));
        command.arg(set).args(RUN_SETTINGS.iter().map(flag))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl clap::FromArgMatches for Settings {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let overrides = matches.get_many::<Override>(SET).into_iter().flatten().cloned().collect();
        Ok(Self { overrides, flags: given(matches, RUN_SETTINGS.iter()) })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// What is set for a tool that drives scenarios of its own choice: the settings of every run but for those that decide what is driven.
pub struct ToolSettings {
    flags: Vec<(&'static Setting, OsString)>,
}

/// The settings of every run that a tool decides itself.
const OWN: [&str; 2] = ["seed", "shard"];

impl ToolSettings {
    /// How a tool is run with these settings.
    ///
    /// # Errors
    /// If a setting cannot have its value.
    pub fn options(&self, global: &Global, audience: Audience) -> Result<Options> {
        let (mut common, settings) = split(Vec::new())?;
        for (setting, value) in &self.flags {
            common.set(setting, value)?;
        }
        Ok(Options { common, settings, search: global.search_path(), audience })
    }

    fn all() -> impl Iterator<Item = &'static Setting> {
        RUN_SETTINGS.iter().filter(|setting| !OWN.contains(&setting.name))
    }
}

impl clap::Args for ToolSettings {
    fn augment_args(command: Command) -> Command {
        command.args(Self::all().map(flag))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl clap::FromArgMatches for ToolSettings {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        Ok(Self { flags: given(matches, Self::all()) })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The settings that the command line sets by their flags.
fn given(
    matches: &ArgMatches,
    settings: impl Iterator<Item = &'static Setting>,
) -> Vec<(&'static Setting, OsString)> {
    let given = |setting: &'static Setting| {
        let value = match setting.value_name {
            Some(_) => matches.get_one::<OsString>(setting.name).cloned(),
            None => matches.get_flag(setting.name).then(|| OsString::from("true")),
        };
        value.map(|value| (setting, value))
    };
    settings.filter_map(given).collect()
}

/// The flag of a setting of every run.
fn flag(setting: &'static Setting) -> Arg {
    let mut flag = Arg::new(setting.name).long(setting.flag()).help(setting.help());
    for (short, alias) in setting.also {
        flag = flag.short(*short).alias(*alias);
    }
    match setting.value_name {
        Some(name) => flag
            .value_name(name)
            // The setting itself says that it cannot be negative.
            .allow_negative_numbers(true)
            .value_parser(OsStringValueParser::new().try_map(|value| setting.check(&value).map(|()| value))),
        None => flag.action(ArgAction::SetTrue),
    }
}
