//! Gives a session frames to evaluate, and takes what they come to in order.

use std::collections::VecDeque;

use pdk_loop::protocol::{EvaluateFrames, Evaluated, EvaluatedFrame, Failure};
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Reply, Session, Ticket};

use super::journal::Journal;

/// How many jobs are under way for each worker, so that none waits for another.
const WINDOW: usize = 4;

/// How long components took, in seconds.
#[derive(Debug, Clone, Copy, Default)]
pub struct Times {
    /// All perturbations.
    pub perturbing: f64,
    /// All predictions.
    pub driving: f64,
}

/// Jobs, of which some are under way.
pub struct Feed<I> {
    jobs: I,
    /// The number of the evaluation.
    evaluation: u64,
    under_way: VecDeque<(EvaluateFrames, UnderWay)>,
    most: usize,
}

/// A job that was given away.
enum UnderWay {
    /// To the session.
    Session(Ticket),
    /// An earlier process did it.
    Known(Vec<EvaluatedFrame>),
}

impl<I: Iterator<Item = EvaluateFrames>> Feed<I> {
    /// These jobs of an evaluation, for this many workers.
    pub fn new(jobs: I, evaluation: u64, workers: usize) -> Self {
        Self { jobs, evaluation, under_way: VecDeque::new(), most: workers * WINDOW }
    }

    /// What the next job came to: something for each of its frames. None if all were taken. `tick` is called with the frames that
    /// are done so far. The journal gets what jobs came to, and is asked before a job is given to the session.
    ///
    /// # Errors
    /// If the session is over, or the journal cannot be written.
    pub fn next(
        &mut self,
        session: &mut Session,
        journal: &mut Journal,
        times: &mut Times,
        tick: &mut dyn FnMut(u64),
    ) -> Result<Option<Vec<EvaluatedFrame>>> {
        while self.under_way.len() < self.most
            && let Some(job) = self.jobs.next()
        {
            let given = match journal.take(self.evaluation, &job) {
                Some(frames) => UnderWay::Known(frames),
                None => UnderWay::Session(session.evaluate(job.clone())),
            };
            self.under_way.push_back((job, given));
        }
        let Some((job, given)) = self.under_way.pop_front() else { return Ok(None) };
        let (known, _) = journal.taken();
        match given {
            UnderWay::Known(frames) => Ok(Some(frames)),
            UnderWay::Session(ticket) => {
                let frames = finish(session, job.clone(), ticket, times, &mut |frames| tick(frames + known))?;
                journal.add(self.evaluation, &job, &frames)?;
                Ok(Some(frames))
            }
        }
    }
}

/// What a job came to. If a component took the process along, its frame is bad, the frames before it are driven again without it, and
/// those behind it begin anew, also for a perturbation that shows something of earlier frames.
fn finish(
    session: &mut Session,
    mut job: EvaluateFrames,
    mut ticket: Ticket,
    times: &mut Times,
    tick: &mut dyn FnMut(u64),
) -> Result<Vec<EvaluatedFrame>> {
    let mut found = Vec::new();
    loop {
        let Failure { message, at, by_driver, .. } = match session.wait(ticket, tick)? {
            Reply::Evaluated(evaluated) => {
                let Evaluated { frames, perturbation_seconds, driver_seconds } = *evaluated;
                times.perturbing += perturbation_seconds;
                times.driving += driver_seconds;
                if frames.len() != job.end - job.start {
                    return Err(Error::new(
                        "a worker returned another number of frames than it was asked for, which is a defect in pdk",
                    ));
                }
                found.extend(frames);
                return Ok(found);
            }
            Reply::Failed(failure) => failure,
            _ => return Err(Error::new("frames came to something else, which is a defect in pdk")),
        };
        let bad = |index: usize| EvaluatedFrame::Bad {
            frame: format!("frame {index}"),
            error: message.clone(),
            by_driver,
        };
        // A perturbation also sees frames before the first that is driven. A worker that does not know `earliest` shows it the same ones
        // again, and ends at the same frame.
        let possible = job.earliest.unwrap_or(job.sequence)..job.end;
        let at = at.and_then(|at| usize::try_from(at).ok()).filter(|at| possible.contains(at));
        let Some(at) = at else {
            found.extend((job.start..job.end).map(bad));
            return Ok(found);
        };
        if at > job.start {
            let before = EvaluateFrames { end: at, ..job.clone() };
            let ticket = session.evaluate(before.clone());
            found.extend(finish(session, before, ticket, times, tick)?);
        }
        if at >= job.start {
            found.push(bad(at));
        }
        let next = at + 1;
        job = EvaluateFrames {
            earliest: Some(next),
            from: job.from.max(next),
            start: job.start.max(next),
            ..job
        };
        if job.start >= job.end {
            return Ok(found);
        }
        ticket = session.evaluate(job.clone());
    }
}
