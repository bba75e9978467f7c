//! Images that count for themselves, alone or in batches.

use numpy::ndarray::Ix4;
use numpy::{
    Ix3, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArray3, PyUntypedArrayMethods,
};
use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{LARGEST_SEED, checked_seed};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Frame, FrameMut};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Known};
use crate::failure::{caught, detached, mistake};
use crate::kept::{self, Kept};
use crate::values;

/// The furthest time in seconds: over 30 years, and still exact to less than a frame.
const MAX_TIME: f64 = 1e9;

/// Perturbs an image, or each image of a batch. See `pdk.perturb`.
#[pyfunction]
#[pyo3(signature = (
    image, perturbation, *, seed=None, frame=0, time=0.0, labels=None, distances=None, out=None, threads=1, **parameters
))]
#[allow(clippy::too_many_arguments, reason = "they are the keyword arguments of a function in Python")]
pub fn perturb<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    perturbation: &Bound<'py, PyAny>,
    seed: Option<Bound<'py, PyAny>>,
    frame: u64,
    time: f64,
    labels: Option<(Vec<String>, Bound<'py, PyAny>)>,
    distances: Option<Bound<'py, PyAny>>,
    out: Option<Bound<'py, PyAny>>,
    threads: usize,
    parameters: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let perturbations = values::chain(perturbation, parameters)?;
    check_time(py, time)?;
    let moment = Moment::new(frame, time).alone();
    if let Ok(images) = image.cast::<PyArray4<u8>>() {
        if labels.is_some() || distances.is_some() {
            return Err(mistake(
                py,
                "`labels` and `distances` are those of one image; give the images of the batch one by one",
            ));
        }
        return batch(py, images, &perturbations, seed.as_ref(), &moment, out, threads);
    }
    let seed = seed.map_or(Ok(0), |seed| seed.extract::<u64>())?;
    check_seed(py, seed)?;
    let array = arrays::image(image)?;
    let src = arrays::frame(py, &array)?;
    let known = Known::new(py, labels, distances, [src.height(), src.width()])?;
    let moment = known.at(moment);
    let target = Target::new(py, src, out)?;
    let mut taken = kept::take(py, &perturbations, seed)?;
    let result = target.apply(py, &mut taken.chain, src, &moment)?;
    kept::keep(py, taken);
    Ok(result)
}

/// Where a perturbed frame goes.
pub enum Target<'py> {
    /// Into a new array.
    Made(Bound<'py, PyArray3<u8>>),
    /// Into one that the caller gave.
    Given(Bound<'py, PyAny>, PyReadwriteArray3<'py, u8>),
}

impl<'py> Target<'py> {
    /// A new array for what becomes of a frame, or `out` if it fits.
    pub fn new(py: Python<'py>, src: Frame<'_>, out: Option<Bound<'py, PyAny>>) -> PyResult<Self> {
        let shape = [src.height(), src.width(), 3];
        match out {
            None => Ok(Self::Made(arrays::made(py, shape))),
            Some(out) => {
                let array = arrays::target::<Ix3>(&out, &shape)?;
                Ok(Self::Given(out, array))
            }
        }
    }

    /// Perturbs the frame. An error is one of the chain.
    pub fn apply(
        self,
        py: Python<'py>,
        chain: &mut Chain,
        src: Frame<'_>,
        moment: &Moment<'_>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (width, height) = (src.width(), src.height());
        match self {
            Self::Made(made) => {
                // SAFETY: it was made here, and nothing else refers to it yet.
                let dst = arrays::frame_mut(py, unsafe { arrays::bytes(&made) }, width, height)?;
                detached(py, || chain.apply(src, dst, moment))?;
                Ok(made.into_any())
            }
            Self::Given(out, mut array) => {
                let bytes = array.as_slice_mut().map_err(|error| mistake(py, error.to_string()))?;
                let dst = arrays::frame_mut(py, bytes, width, height)?;
                detached(py, || chain.apply(src, dst, moment))?;
                Ok(out)
            }
        }
    }
}

/// Refuses times that are none.
pub fn check_time(py: Python<'_>, time: f64) -> PyResult<()> {
    if (-MAX_TIME..=MAX_TIME).contains(&time) {
        return Ok(());
    }
    Err(mistake(py, format!("`time` is {time:e}, but has to be a number of seconds within {MAX_TIME:e}")))
}

/// The images of a batch, each with a seed of its own, spread over threads.
fn batch<'py>(
    py: Python<'py>,
    images: &Bound<'py, PyArray4<u8>>,
    perturbations: &[AppliedPerturbation],
    seed: Option<&Bound<'py, PyAny>>,
    moment: &Moment<'_>,
    out: Option<Bound<'py, PyAny>>,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let shape: [usize; 4] = [images.shape()[0], images.shape()[1], images.shape()[2], images.shape()[3]];
    let [count, height, width, channels] = shape;
    let size = height * width * channels;
    if channels != 3 || size == 0 {
        return Err(arrays::unfit(images.as_any()));
    }
    let seeds = seeds(py, seed, count)?;
    let packed = arrays::packed(py, images.as_any())?;
    let packed = packed.cast::<PyArray4<u8>>().map_err(|_| arrays::unfit(images.as_any()))?;
    let read = packed.try_readonly().map_err(|error| mistake(py, error.to_string()))?;
    let src = read.as_slice().map_err(|error| mistake(py, error.to_string()))?;
    let threads = threads.clamp(1, count.max(1));
    let mut taken =
        (0..threads).map(|_| kept::take(py, perturbations, 0)).collect::<PyResult<Vec<Kept>>>()?;
    let each = count.div_ceil(threads).max(1);
    let mut work = |dst: &mut [u8]| {
        let sources = seeds.chunks(each).zip(src.chunks(size * each)).zip(dst.chunks_mut(size * each));
        let parts = taken.iter_mut().zip(sources);
        let mut parts: Vec<Part<'_>> = parts
            .map(|(taken, ((seeds, src), dst))| Part {
                chain: &mut taken.chain,
                seeds,
                src,
                dst,
                width,
                height,
            })
            .collect();
        detached(py, || {
            std::thread::scope(|scope| {
                let work = |part: &mut Part<'_>| part.perturb(perturbations, moment);
                let started: Vec<_> =
                    parts.iter_mut().map(|part| scope.spawn(move || caught(|| work(part)))).collect();
                let lost = |_| Err(Error::of(ErrorKind::Panic, "a thread of the batch is lost"));
                started.into_iter().try_for_each(|thread| thread.join().unwrap_or_else(lost))
            })
        })
    };
    let result = match out {
        None => {
            let made = arrays::made(py, shape);
            // SAFETY: it was made here, and nothing else refers to it yet.
            work(unsafe { arrays::bytes(&made) })?;
            made.into_any()
        }
        Some(out) => {
            let mut target = arrays::target::<Ix4>(&out, &shape)?;
            work(target.as_slice_mut().map_err(|error| mistake(py, error.to_string()))?)?;
            out
        }
    };
    for chain in taken {
        kept::keep(py, chain);
    }
    Ok(result)
}

/// What one thread does of a batch: images one after the other, in `src` and `dst`, with a seed for each.
struct Part<'a> {
    chain: &'a mut Chain,
    seeds: &'a [u64],
    src: &'a [u8],
    dst: &'a mut [u8],
    width: usize,
    height: usize,
}

impl Part<'_> {
    fn perturb(&mut self, perturbations: &[AppliedPerturbation], moment: &Moment<'_>) -> Result<()> {
        let (width, height) = (self.width, self.height);
        let size = width * height * 3;
        let images = self.src.chunks_exact(size).zip(self.dst.chunks_exact_mut(size));
        for (seed, (src, dst)) in self.seeds.iter().zip(images) {
            self.chain.begin_again(perturbations, *seed);
            self.chain.apply(
                Frame::new(src, width, height).map_err(Error::new)?,
                FrameMut::new(dst, width, height).map_err(Error::new)?,
                moment,
            )?;
        }
        Ok(())
    }
}

/// Refuses what is too large for a seed, as everywhere else.
pub fn check_seed(py: Python<'_>, seed: u64) -> PyResult<()> {
    checked_seed(seed).map(drop).map_err(|error| mistake(py, error.message()))
}

/// A seed for each image: those that are given, or one after the other from the one that is.
fn seeds(py: Python<'_>, seed: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Vec<u64>> {
    let Some(seed) = seed else { return Ok((0..count as u64).collect()) };
    if let Ok(first) = seed.extract::<u64>() {
        check_seed(py, first.saturating_add((count as u64).saturating_sub(1)))?;
        return Ok((first..).take(count).collect());
    }
    let seeds: Vec<u64> = seed.extract()?;
    seeds.iter().try_for_each(|seed| check_seed(py, *seed))?;
    if seeds.len() != count {
        return Err(mistake(
            py,
            format!("there are {} seeds for {count} images; give one for each, or the first", seeds.len()),
        ));
    }
    Ok(seeds)
}

/// A number, fit for a seed, that follows from the values of an array alone: for draws that are those of an image, wherever it comes from.
#[pyfunction]
pub fn identity(py: Python<'_>, image: &Bound<'_, PyAny>) -> PyResult<u64> {
    let packed = arrays::packed(py, image)?;
    let array: PyReadonlyArrayDyn<'_, u8> = packed.extract().map_err(|_| arrays::unfit(image))?;
    let shape: Vec<u64> = array.shape().iter().map(|&length| length as u64).collect();
    let values = array.as_slice().map_err(|error| mistake(py, error.to_string()))?;
    detached(py, || {
        let mut hasher = blake3::Hasher::new_derive_key("pdk identity of an image, version 1");
        shape.iter().for_each(|length| _ = hasher.update(&length.to_le_bytes()));
        hasher.update(values);
        let mut number = [0; 8];
        hasher.finalize_xof().fill(&mut number);
        Ok(u64::from_le_bytes(number) & LARGEST_SEED)
    })
}
