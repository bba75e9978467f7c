//! Where points, boxes and the pixels of masks go.

use numpy::{AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArrayLike2, PyArrayMethods};
use pdk_chain::moment::Moment;
use pdk_labels::Labels;
use pdk_sdk::error::Result;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{detached, mistake};
use crate::images::{check_seed, check_time};
use crate::{kept, values};

/// Which image labels belong to, as for `perturb`.
struct Asked<'a, 'py> {
    py: Python<'py>,
    perturbation: &'a Bound<'py, PyAny>,
    size: (usize, usize),
    seed: u64,
    frame: u64,
    time: f64,
    parameters: Option<&'a Bound<'py, PyDict>>,
}

impl Asked<'_, '_> {
    /// Does something with the labels.
    fn answer<T: Send>(&self, work: impl FnOnce(&mut Labels<'_>) -> Result<T> + Send) -> PyResult<T> {
        let py = self.py;
        let (height, width) = self.size;
        if height == 0 || width == 0 || height.saturating_mul(width) > i32::MAX as usize {
            return Err(mistake(
                py,
                format!("`size` is {:?}, but has to be height and width of the image", self.size),
            ));
        }
        check_time(py, self.time)?;
        check_seed(py, self.seed)?;
        let perturbations = values::chain(self.perturbation, self.parameters)?;
        let mut taken = kept::take(py, &perturbations, self.seed)?;
        let moment = Moment::new(self.frame, self.time).alone();
        let result = detached(py, || {
            taken.chain.moves()?;
            work(&mut Labels::new(&mut taken.chain, [width, height], &moment))
        })?;
        kept::keep(py, taken);
        Ok(result)
    }
}

/// Rows of numbers of an argument.
fn rows<'py, const N: usize>(
    value: &Bound<'py, PyAny>,
    name: &str,
    columns: &str,
) -> PyResult<Vec<[f64; N]>> {
    let py = value.py();
    let wrong = || mistake(py, format!("`{name}` has to be an array of n x {N} numbers: {columns}"));
    let array: PyArrayLike2<'py, f64, AllowTypeChange> = value.extract().map_err(|_| wrong())?;
    let view = array.as_array();
    let (found, filled) = (view.shape()[1], view.shape()[0] > 0);
    if found != N && filled {
        return Err(wrong());
    }
    Ok(view.rows().into_iter().map(|row| std::array::from_fn(|column| row[column])).collect())
}

fn array<'py, const N: usize>(py: Python<'py>, rows: Vec<[f64; N]>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let count = rows.len();
    rows.into_iter().flatten().collect::<Vec<_>>().into_pyarray(py).reshape([count, N])
}

/// Moves points. See `pdk.move_points`.
#[pyfunction]
#[pyo3(signature = (points, perturbation, *, size, seed=0, frame=0, time=0.0, **parameters))]
#[allow(clippy::too_many_arguments, reason = "they are the keyword arguments of a function in Python")]
pub fn move_points<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    perturbation: &Bound<'py, PyAny>,
    size: (usize, usize),
    seed: u64,
    frame: u64,
    time: f64,
    parameters: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut points: Vec<[f64; 2]> = rows(points, "points", "x and y")?;
    let asked = Asked { py, perturbation, size, seed, frame, time, parameters };
    let moved = asked.answer(|labels| {
        labels.points(&mut points)?;
        Ok(points)
    })?;
    array(py, moved)
}

/// Boxes, one a row, and how much of each is visible.
type Boxes<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Moves boxes. See `pdk.move_boxes`.
#[pyfunction]
#[pyo3(signature = (boxes, perturbation, *, size, seed=0, frame=0, time=0.0, **parameters))]
#[allow(clippy::too_many_arguments, reason = "they are the keyword arguments of a function in Python")]
pub fn move_boxes<'py>(
    py: Python<'py>,
    boxes: &Bound<'py, PyAny>,
    perturbation: &Bound<'py, PyAny>,
    size: (usize, usize),
    seed: u64,
    frame: u64,
    time: f64,
    parameters: Option<&Bound<'py, PyDict>>,
) -> PyResult<Boxes<'py>> {
    let boxes: Vec<[f64; 4]> = rows(boxes, "boxes", "left, top, right and bottom")?;
    let asked = Asked { py, perturbation, size, seed, frame, time, parameters };
    let moved = asked.answer(|labels| {
        boxes.into_iter().map(|edges| labels.moved_box(edges)).collect::<Result<Vec<_>>>()
    })?;
    let visible: Vec<f64> = moved.iter().map(|moved| moved.visible).collect();
    let edges = moved.into_iter().map(|moved| moved.edges).collect();
    Ok((array(py, edges)?, visible.into_pyarray(py)))
}

/// Where the pixels of a perturbed image come from. See `pdk.source_pixels`.
#[pyfunction]
#[pyo3(signature = (perturbation, *, size, seed=0, frame=0, time=0.0, **parameters))]
#[allow(clippy::too_many_arguments, reason = "they are the keyword arguments of a function in Python")]
pub fn source_pixels<'py>(
    py: Python<'py>,
    perturbation: &Bound<'py, PyAny>,
    size: (usize, usize),
    seed: u64,
    frame: u64,
    time: f64,
    parameters: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let asked = Asked { py, perturbation, size, seed, frame, time, parameters };
    let sources = asked.answer(|labels| labels.sources())?;
    let places: Vec<i64> = sources.into_iter().map(|source| source.map_or(-1, |at| at as i64)).collect();
    places.into_pyarray(py).reshape([size.0, size.1])
}
