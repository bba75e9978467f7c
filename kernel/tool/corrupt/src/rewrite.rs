//! Files of a recording that its reader writes, with perturbed frames, and files that are carried over as they are.

use std::fs;
use std::rc::Rc;

use pdk_chain::moment::Moment;
use pdk_labels::Labels;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::form::Rewrite;
use pdk_sdk::prelude::{Dataset, Entry, Frame, FrameMut};
use pdk_supervise::calls::{self, Function};

use crate::conditions::Condition;
use crate::unit::{Report, Situation, Worker, hash_of};

impl Worker<'_> {
    /// A file of the recording under a condition, as its reader writes it; `moves` if the condition moves what is in the frames.
    pub(super) fn rewrite(
        &mut self,
        name: &str,
        condition: &Condition,
        moves: bool,
        report: Report<'_>,
    ) -> Result<()> {
        let source = hash_of(&self.path(name))?;
        let seed = self.job.options.seed;
        self.make_file(condition, (name, &source, Some(seed)), report, |worker, part| {
            let mirrored = if moves { worker.mirrored_frames(condition)? } else { Vec::new() };
            let (into, quality) = (part.to_owned(), worker.job.options.quality);
            let wanted = Rewrite { file: name.to_owned(), into, quality, mirrored };
            let mut writer = match worker.writer.take() {
                Some(writer) => writer,
                None => worker.open()?,
            };
            let written = calls::call("the dataset", Function::Rewrite, || {
                writer.rewrite(&wanted, &mut |index, source, target| {
                    worker.frame_into(condition, index, source, target)
                })
            });
            worker.writer = Some(writer);
            written?;
            hash_of(part)
        })
    }

    /// A file under a condition as it is.
    pub(super) fn carry(&mut self, name: &str, condition: &Condition, report: Report<'_>) -> Result<()> {
        let path = self.path(name);
        let source = hash_of(&path)?;
        self.make_file(condition, (name, &source, None), report, |_, part| {
            fs::copy(&path, part).place(format_args!("cannot copy {}", path.display()))?;
            hash_of(part)
        })
    }

    fn open(&self) -> Result<Box<dyn Dataset>> {
        let reader = self.job.reader.as_ref().ok_or_else(without_reader)?;
        Ok(self.job.registry.dataset(&reader.name, &reader.parameters)?.0)
    }

    /// Perturbs a frame of the recording.
    fn frame_into(
        &mut self,
        condition: &Condition,
        index: usize,
        source: Frame<'_>,
        mut target: FrameMut<'_>,
    ) -> Result<()> {
        let entry = Entry { frame: source.to_buf(), time: self.time(index)?, ..Entry::default() };
        let seed = self.job.options.seed;
        let situation = Situation { entry, seed, frame: index as u64, recorded: true };
        let history = self.perturb(condition, &situation)?;
        if history > 0 {
            self.recent.insert(index, Rc::new(situation.entry));
        }
        target.copy_from(self.perturbed.as_ref());
        self.steps += 1;
        self.job.progress.inc(1);
        Ok(())
    }

    /// When a frame of the recording was taken.
    fn time(&self, index: usize) -> Result<f64> {
        let dataset = self.dataset.as_ref().ok_or_else(without_reader)?;
        let time = dataset.position(index).time;
        Ok(if time.is_finite() { time } else { 0.0 })
    }

    /// Whether each frame of the recording is mirrored; empty if none is. What moves things mirrors all frames of a size or none, unless its
    /// draws decide it, which are those of the frame.
    fn mirrored_frames(&mut self, condition: &Condition) -> Result<Vec<bool>> {
        let count = self.dataset.as_ref().ok_or_else(without_reader)?.len();
        let size =
            self.dataset.iter_mut().flat_map(|dataset| (0..count).find_map(|index| dataset.read(index).ok()));
        let size = size.map(|entry| [entry.frame.width(), entry.frame.height()]).next();
        let size = size.ok_or_else(|| Error::new("none of its frames can be read"))?;
        let mut mirrored = Vec::with_capacity(count);
        for index in 0..count {
            let moment = Moment::new(index as u64, self.time(index)?).alone();
            let chain = Self::chain(&mut self.chains, self.job, condition, self.job.options.seed)?;
            mirrored.push(Labels::new(chain, size, &moment).mirrors()?);
        }
        Ok(if mirrored.contains(&true) { mirrored } else { Vec::new() })
    }
}

fn without_reader() -> Error {
    Error::new("there is no reader for it")
}
