//! The end of a run: what is left is taken, and the record is completed.

use std::time::SystemTime;

use pdk_model::shard::{EvaluatedFrames, ShardList};
use pdk_record::directory::{PERFORMANCE, SHARD, SUMMARY};
use pdk_record::times::LoopTimes;
use pdk_sdk::error::{Error, Result};
use pdk_session::interrupt::{self, Wish};
use serde_json::json;

use super::Host;
use super::driving::stop_if_dropped;
use super::frames::Frames;
use crate::finished::{Finished, Summary};

impl Host {
    /// Completes the record after the pipeline has come to its end, or to an error. Of several failures the first in this
    /// order is reported: that of the script, what kept scenarios from being driven, that of the record, those of scenarios, a setting
    /// that the pipeline does not have.
    pub fn finish(mut self, script: Result<()>) -> Finished {
        let rest = match script.is_ok() || interrupt::wish() == Wish::Finish {
            true => self.take_rest(),
            false => Ok(()),
        };
        self.frames.finish();
        if let Some(directory) = &self.record.directory {
            Frames::forget(directory.path());
        }
        let (all, failed) = (self.scenarios.count(), self.scenarios.failed());
        let own = self.scenarios.own();
        let outcomes = own.map(|(submitted, came)| (submitted.clone(), came.outcome.clone())).collect();
        let summary = Summary { outcomes, evaluations: std::mem::take(&mut self.evaluations.summaries) };
        let whole = script.is_ok() && rest.is_ok();
        let written =
            self.complete(&summary).and_then(|()| if whole { self.complete_part() } else { Ok(()) });
        // A component that crashes only when it is dropped goes wrong when it is made, and scenarios go well with it all the same.
        let good = self.scenarios.own().filter(|(_, came)| came.error.is_none());
        let mut troubles = self.components.troubles(good.map(|(submitted, _)| submitted));
        for trouble in self.session.end() {
            if !troubles.contains(&trouble) {
                troubles.push(trouble);
            }
        }
        if !self.scenarios.kept.is_empty() {
            self.account.speed.insert(
                0,
                format!("{} of {all} scenarios were in the record already", self.scenarios.kept.len()),
            );
        }
        self.components.settled.sort();
        for (parameter, value) in &self.components.settled {
            self.account.speed.push(format!("{parameter}: {value}"));
        }
        let scenarios = failed.first().map(|first| {
            Error::new(match all {
                1 => format!("the scenario could not be driven because a component failed: {first}"),
                _ => format!(
                    "{} of {all} scenarios could not be driven because a component failed; the first: {first}",
                    failed.len()
                ),
            })
        });
        let trouble = troubles.first().map(|first| {
            Error::new(format!(
                "{first}; what was recorded is kept, but what was computed in the same process before may be wrong"
            ))
        });
        self.account.warnings.extend(troubles.into_iter().skip(1));
        let overrides = self.setup.settings.check().err();
        // Also where the script made something else of it.
        let undriven = self.scenarios.outcomes.values().find_map(|outcome| outcome.as_ref().err().cloned());
        let failures = [script.err(), rest.err(), undriven, written.err(), scenarios, trouble, overrides];
        Finished {
            record: self.record.directory.as_ref().map(|directory| directory.path().to_owned()),
            summary,
            speed: self.account.speed,
            warnings: self.account.warnings,
            failure: failures.into_iter().flatten().next(),
        }
    }

    /// Takes the outcomes that the script has not waited for: all if the script came to its end, and those in flight if the user
    /// interrupted it. After an error of the script they are not wanted.
    fn take_rest(&mut self) -> Result<()> {
        let mut rest = self.scenarios.rest();
        let mut result = Ok(());
        while let Some(ticket) = self.take_next(&rest)? {
            stop_if_dropped()?;
            rest.remove(&ticket);
            if let Some(Err(error)) = self.scenarios.outcomes.get(&ticket) {
                result = result.and(Err(error.clone()));
            }
        }
        result
    }

    /// Notes in the record of a part which scenarios the whole run has, so that parts which went different ways are not put together.
    fn complete_part(&mut self) -> Result<()> {
        let (Some(directory), Some(shard)) = (&self.record.directory, self.setup.common.shard) else {
            return Ok(());
        };
        let scenarios = self.scenarios.ids();
        let evaluations = self.record.evaluations.iter().map(|evaluation| EvaluatedFrames {
            frames: evaluation.frames,
            cells: evaluation.perturbations.iter().map(ToString::to_string).collect(),
        });
        let evaluations: Vec<EvaluatedFrames> = evaluations.collect();
        let own_frames: usize = self.evaluations.own.iter().sum();
        let frames: usize = evaluations.iter().map(|evaluation| evaluation.frames).sum();
        let parts = [
            (shard.own(scenarios.len()).count(), scenarios.len(), "scenarios"),
            (own_frames, frames, "frames"),
        ];
        let parts = parts.iter().filter(|(_, all, _)| *all > 0);
        let parts: Vec<String> = parts.map(|(own, all, what)| format!("{own} of {all} {what}")).collect();
        self.account.speed.push(format!("part {shard} of the run: {}", parts.join(", ")));
        directory.write_json(SHARD, &ShardList { shard, scenarios, evaluations })
    }

    fn complete(&mut self, summary: &Summary) -> Result<()> {
        let Some(directory) = &self.record.directory else { return Ok(()) };
        self.session.finish()?;
        directory.write_json(SUMMARY, summary)?;
        let total = self.session.performance();
        self.account.warnings.extend(total.noticed());
        let stages = total.times.summary();
        // The times of the process that drove are worth more than those of one that did not.
        if stages.steps == 0
            && self.evaluations.times.is_empty()
            && directory.path().join(PERFORMANCE).is_file()
        {
            return Ok(());
        }
        if stages.overruns > 0 {
            self.account.warnings.push(format!(
                "{} of {} steps in real time took longer than a frame lasts; {PERFORMANCE} has the times of the stages",
                stages.overruns, stages.steps
            ));
        }
        let drive = (stages.steps > 0).then(|| {
            let (wall, LoopTimes { steps, .. }) = (total.wall_seconds, &stages);
            let (rate, factor) = (*steps as f64 / wall, total.simulated_seconds / wall);
            self.account.speed.push(format!(
                "{steps} frames in {wall:.1} s: {rate:.0} a second, {factor:.1} times real time"
            ));
            json!({
                "workers": total.slots, "wall_seconds": wall, "frames_per_second": rate,
                "real_time_factor": factor, "stages": stages,
            })
        });
        let started =
            self.account.started.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
        let performance = json!({
            "started_unix_seconds": started, "drive": drive, "evaluations": self.evaluations.times,
        });
        directory.write_json(PERFORMANCE, &performance)
    }
}
