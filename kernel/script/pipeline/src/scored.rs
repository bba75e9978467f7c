//! An evaluation whose metric is a function of the pipeline: the function gets the outputs for each picture, and returns numbers. A
//! pipeline that is another program gets them picture by picture, and says what its function returned.

use mlua::{ExternalError, Function, Lua, Table, Value as LuaValue};
use pdk_sdk::error::{Error, Result};
use serde_json::{Value, json};

use crate::bridge::{call, with_host};
use crate::evaluation::TaskFrame;
use crate::host::{Host, UnderWay};
use crate::task::Piece;
use crate::values::{from_lua, to_lua};

/// What errors call the result of a metric.
const RETURNED: &str = "what `score` of the task returned";

/// The function `score` of the task of a request, and the request without it; none if it has none.
///
/// # Errors
/// If the virtual machine is out of memory.
pub fn score_of(lua: &Lua, request: &LuaValue) -> mlua::Result<Option<(LuaValue, Function)>> {
    let Some(table) = request.as_table() else { return Ok(None) };
    let LuaValue::Table(task) = table.raw_get::<LuaValue>("task")? else { return Ok(None) };
    let LuaValue::Function(score) = task.raw_get::<LuaValue>("score")? else { return Ok(None) };
    let task = without(lua, &task, "score")?;
    let request = without(lua, table, "task")?;
    request.raw_set("task", task)?;
    Ok(Some((LuaValue::Table(request), score)))
}

fn without(lua: &Lua, table: &Table, field: &str) -> mlua::Result<Table> {
    let copy = lua.create_table()?;
    for pair in table.pairs::<LuaValue, LuaValue>() {
        let (key, value) = pair?;
        if key.as_string().is_none_or(|key| key != field) {
            copy.raw_set(key, value)?;
        }
    }
    Ok(copy)
}

/// Evaluates with a function of the pipeline.
///
/// # Errors
/// What the function fails with, and what keeps pictures from being evaluated.
pub fn conduct(lua: &Lua, request: Value, score: &Function) -> mlua::Result<LuaValue> {
    let mut run = with_host(lua, |host| host.begin_task(request))?;
    while let Some(mut piece) = with_host(lua, |host| host.next_piece(&mut run))? {
        for frame in &mut piece.frames {
            let TaskFrame::Good { original, perturbed, .. } = frame else { continue };
            for kept in std::iter::once(original).chain(perturbed) {
                let scored: LuaValue = score.call(to_lua(lua, kept)?)?;
                *kept = numbers(&scored).map_err(ExternalError::into_lua_err)?;
            }
        }
        with_host(lua, |host| host.keep_piece(&mut run, piece))?;
    }
    call(lua, |host| host.finish_task(run))
}

/// An evaluation of a program whose function has a picture.
pub struct Scoring {
    run: UnderWay,
    piece: Piece,
    /// The place of the picture in the piece.
    at: usize,
}

/// What a program gets.
pub enum Step {
    /// What was seen of a picture: as it is, and under each perturbation.
    Picture(Box<Scoring>, Value),
    /// What all pictures came to.
    Finished(Value),
}

impl Scoring {
    /// Begins an evaluation.
    ///
    /// # Errors
    /// If the request is not one, or the session is over.
    pub fn begin(host: &mut Host, request: Value) -> Result<Step> {
        let run = host.begin_task(request)?;
        Self::next_piece(host, run)
    }

    fn next_piece(host: &mut Host, mut run: UnderWay) -> Result<Step> {
        match host.next_piece(&mut run)? {
            Some(piece) => Self { run, piece, at: 0 }.step(host),
            None => Ok(Step::Finished(host.finish_task(run)?)),
        }
    }

    /// The next picture that could be evaluated.
    fn step(mut self, host: &mut Host) -> Result<Step> {
        while let Some(frame) = self.piece.frames.get(self.at) {
            if let TaskFrame::Good { original, perturbed, .. } = frame {
                let seen = std::iter::once(original).chain(perturbed).cloned().collect();
                return Ok(Step::Picture(Box::new(self), seen));
            }
            self.at += 1;
        }
        host.keep_piece(&mut self.run, self.piece)?;
        Self::next_piece(host, self.run)
    }

    /// Goes on with what the function returned for the picture as it is and under each perturbation.
    ///
    /// # Errors
    /// If that are not as many numbers, or the session is over.
    pub fn go_on(mut self, host: &mut Host, returned: Vec<Value>) -> Result<Step> {
        if let Some(TaskFrame::Good { original, perturbed, .. }) = self.piece.frames.get_mut(self.at) {
            let (wanted, given) = (perturbed.len() + 1, returned.len());
            if given != wanted {
                return Err(Error::new(format!(
                    "`scored` has {given} results, but has to have {wanted}, one for each that was seen of the picture"
                )));
            }
            for (kept, returned) in std::iter::once(original).chain(perturbed).zip(returned) {
                *kept = named(returned)?;
            }
        }
        self.at += 1;
        self.step(host)
    }
}

/// What a function returned: numbers by name.
fn numbers(scored: &LuaValue) -> Result<Value> {
    from_lua(scored, RETURNED).and_then(named)
}

/// What a metric returned, as numbers by name: a number alone is the score.
///
/// # Errors
/// If it is neither a number nor a table of numbers.
pub fn named(returned: Value) -> Result<Value> {
    match &returned {
        Value::Number(_) => Ok(json!({ "score": returned })),
        Value::Object(numbers) if !numbers.is_empty() && numbers.values().all(Value::is_number) => {
            Ok(returned)
        }
        _ => Err(Error::new(format!(
            "{RETURNED} is {returned}, but has to be a number, or a table of numbers such as {{ error = 0.5 }}"
        ))),
    }
}
