//! The frames of a sequence, one after the other.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_model::perturbation::AppliedPerturbation;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use crate::arrays::{self, Known};
use crate::failure::mistake;
use crate::images::{Target, check_seed, check_time};
use crate::{components, values};

/// A function that makes an object again, its arguments, and the attributes that the object has besides.
type Reduced<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>, Bound<'py, PyAny>);

/// Perturbations of the frames of a sequence. See `pdk.Perturbation`.
#[pyclass(module = "pdk_perturb", frozen, subclass)]
pub struct Perturbation {
    perturbations: Vec<AppliedPerturbation>,
    /// Frames a second.
    fps: f64,
    /// How many frames before a frame decide what becomes of it.
    history: usize,
    state: Mutex<State>,
}

struct State {
    /// None while it is at work. One that has failed is made anew for the next frame.
    chain: Option<Chain>,
    is_at_work: bool,
    seed: u64,
    /// The number of the frame that comes next.
    next: u64,
}

#[pymethods]
impl Perturbation {
    #[new]
    #[pyo3(signature = (perturbation, *, seed=0, fps=20.0, **parameters))]
    fn new(
        py: Python<'_>,
        perturbation: &Bound<'_, PyAny>,
        seed: u64,
        fps: f64,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        if !fps.is_finite() || fps <= 0.0 {
            return Err(mistake(
                py,
                format!("`fps` is {fps}, but has to be a number of frames a second above 0"),
            ));
        }
        check_seed(py, seed)?;
        let perturbations = values::chain(perturbation, parameters)?;
        // They are checked here, not at the first frame.
        let chain = components::make(py, &perturbations, seed)?;
        let history = chain.history();
        let state = Mutex::new(State { chain: Some(chain), is_at_work: false, seed, next: 0 });
        Ok(Self { perturbations, fps, history, state })
    }

    /// Perturbs the next frame, or the one with this number.
    #[pyo3(signature = (
        image, *, frame=None, time=None, speed=None, level=None, labels=None, distances=None, out=None
    ))]
    #[allow(clippy::too_many_arguments, reason = "they are the keyword arguments of a function in Python")]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        image: &Bound<'py, PyAny>,
        frame: Option<u64>,
        time: Option<f64>,
        speed: Option<f64>,
        level: Option<Bound<'py, PyAny>>,
        labels: Option<(Vec<String>, Bound<'py, PyAny>)>,
        distances: Option<Bound<'py, PyAny>>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let array = arrays::image(image)?;
        let src = arrays::frame(py, &array)?;
        let known = Known::new(py, labels, distances, [src.height(), src.width()])?;
        let target = Target::new(py, src, out)?;
        let at_level = level.map(|level| values::at_level(&self.perturbations, &level)).transpose()?;
        let perturbations = at_level.as_ref().unwrap_or(&self.perturbations);
        components::check_levels(py, perturbations)?;
        // The chain is taken once nothing but the chain can fail, because one that fails is lost with the frames that it remembers.
        let (taken, seed, number, time) = {
            let mut state = self.idle(py)?;
            let number = frame.unwrap_or(state.next);
            let time = time.unwrap_or(number as f64 / self.fps);
            check_time(py, time)?;
            state.is_at_work = true;
            (state.chain.take(), state.seed, number, time)
        };
        let work = || {
            let mut chain = match taken {
                Some(chain) => chain,
                None => components::make(py, &self.perturbations, seed)?,
            };
            // The frame before may have been at another one.
            chain.set_levels(perturbations);
            let moment = Moment { speed, ..known.at(Moment::new(number, time)) };
            let result = target.apply(py, &mut chain, src, &moment)?;
            Ok((result, chain))
        };
        let result: PyResult<_> = work();
        let mut state = self.state(py);
        state.is_at_work = false;
        let (result, chain) = result?;
        (state.chain, state.next) = (Some(chain), number.saturating_add(1));
        Ok(result)
    }

    /// Begins another sequence: with its first frame, and with another seed if one is given.
    #[pyo3(signature = (seed=None))]
    fn reset(&self, py: Python<'_>, seed: Option<u64>) -> PyResult<()> {
        seed.map_or(Ok(()), |seed| check_seed(py, seed))?;
        let mut state = self.idle(py)?;
        state.seed = seed.unwrap_or(state.seed);
        state.next = 0;
        let seed = state.seed;
        if let Some(chain) = &mut state.chain {
            chain.begin_again(&self.perturbations, seed);
        }
        Ok(())
    }

    /// The perturbations as they are written on the command line.
    #[getter]
    fn perturbations(&self) -> Vec<String> {
        self.perturbations.iter().map(ToString::to_string).collect()
    }

    /// The seed of the sequence.
    #[getter]
    fn seed(&self, py: Python<'_>) -> u64 {
        self.state(py).seed
    }

    /// The number of the frame that comes next.
    #[getter]
    fn frame(&self, py: Python<'_>) -> u64 {
        self.state(py).next
    }

    /// Frames a second.
    #[getter]
    fn fps(&self) -> f64 {
        self.fps
    }

    /// How many frames before a frame decide what becomes of it.
    #[getter]
    fn history(&self) -> usize {
        self.history
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("pdk.Perturbation({:?}, seed={}, fps={})", self.perturbations(), self.seed(py), self.fps)
    }

    /// For other processes: they find the same components, and go on where this one is. Earlier frames stay here. What a class in Python that
    /// is made from this one adds goes along.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let (py, this) = (slf.py(), slf.get());
        let (seed, next) = {
            let state = this.state(py);
            (state.seed, state.next)
        };
        if this.history > 0 && next > 0 {
            return Err(mistake(
                py,
                "this sequence cannot be copied in its middle, because one of its perturbations shows earlier frames; copy it before its first \
                 frame, or after `reset`",
            ));
        }
        let (plugins, drop_ins) = components::searched(py);
        let resume = py.import("pdk_perturb._pdk")?.getattr("resume")?;
        let arguments =
            (slf.as_any().get_type(), this.perturbations(), seed, this.fps, next, plugins, drop_ins);
        // This class itself has none.
        let attributes = slf.as_any().getattr("__dict__").unwrap_or_else(|_| py.None().into_bound(py));
        Ok((resume, arguments.into_pyobject(py)?, attributes))
    }
}

impl Perturbation {
    /// Needs the interpreter, see the crate's documentation.
    fn state(&self, _: Python<'_>) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state, unless another thread is at work with it.
    fn idle(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, State>> {
        let state = self.state(py);
        if state.is_at_work {
            return Err(mistake(
                py,
                "this sequence is at work in another thread; make a Perturbation for each",
            ));
        }
        Ok(state)
    }
}

/// A [`Perturbation`] from another process, of this class.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "they are what `__reduce__` returns")]
pub fn resume<'py>(
    py: Python<'py>,
    class: &Bound<'py, PyType>,
    perturbations: &Bound<'py, PyAny>,
    seed: u64,
    fps: f64,
    next: u64,
    plugins: Vec<PathBuf>,
    drop_ins: Vec<PathBuf>,
) -> PyResult<Bound<'py, PyAny>> {
    if components::searched(py) != (plugins.clone(), drop_ins.clone()) {
        components::search(py, plugins, drop_ins)?;
    }
    let given = PyDict::new(py);
    given.set_item("seed", seed)?;
    given.set_item("fps", fps)?;
    // What the class does when it is made has been done.
    let made = py.get_type::<Perturbation>().call_method("__new__", (class, perturbations), Some(&given))?;
    made.cast::<Perturbation>()?.get().state(py).next = next;
    Ok(made)
}
