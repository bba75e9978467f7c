//! Gives a session frames to evaluate, and takes what they come to in order.

use std::collections::VecDeque;

use pdk_loop::protocol::{EvaluateFrames, Evaluated, EvaluatedFrame, Failure};
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Reply, Session, Ticket};

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
    under_way: VecDeque<(EvaluateFrames, Ticket)>,
    most: usize,
}

impl<I: Iterator<Item = EvaluateFrames>> Feed<I> {
    /// These jobs, for this many workers.
    pub fn new(jobs: I, workers: usize) -> Self {
        Self { jobs, under_way: VecDeque::new(), most: workers * WINDOW }
    }

    /// What the next job came to: something for each of its frames. None if all were taken. `tick` is called with the frames that the
    /// session has done so far.
    ///
    /// # Errors
    /// If the session is over.
    pub fn next(
        &mut self,
        session: &mut Session,
        times: &mut Times,
        tick: &mut dyn FnMut(u64),
    ) -> Result<Option<Vec<EvaluatedFrame>>> {
        while self.under_way.len() < self.most
            && let Some(job) = self.jobs.next()
        {
            let ticket = session.evaluate(job.clone());
            self.under_way.push_back((job, ticket));
        }
        let Some((job, ticket)) = self.under_way.pop_front() else { return Ok(None) };
        finish(session, job, ticket, times, tick).map(Some)
    }
}

/// What a job came to. If a component took the process along, its frame is bad, the frames before it are driven again without it, and
/// those behind it begin anew.
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
        let at = at.and_then(|at| usize::try_from(at).ok()).filter(|at| (job.from..job.end).contains(at));
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
        job = EvaluateFrames { from: at + 1, start: job.start.max(at + 1), ..job };
        if job.start >= job.end {
            return Ok(found);
        }
        ticket = session.evaluate(job.clone());
    }
}
