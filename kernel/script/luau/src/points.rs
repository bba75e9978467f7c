//! How a perturbation in a script moves points: functions of the script for one point, called for many at once.

use mlua::{Function, Table, Value};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::perturbation::Way;

use crate::buffers::buffer_bytes;
use crate::sandbox::Sandbox;

/// Calls a function for each point of a buffer and puts what it returns in its place.
const EACH: &[u8] = br#"
return function(move, points, width, height, cx)
    for at = 0, buffer.len(points) - 16, 16 do
        local x, y = move(buffer.readf64(points, at), buffer.readf64(points, at + 8), width, height, cx)
        if x == nil and y == nil then
            x, y = 0 / 0, 0 / 0
        elseif type(x) ~= "number" or type(y) ~= "number" then
            error("it returns " .. type(x) .. " and " .. type(y) .. ", but has to return x and y, or nothing for a point that has nowhere to go", 0)
        end
        buffer.writef64(points, at, x)
        buffer.writef64(points, at + 8, y)
    end
end
"#;

/// What a script has to say of points.
pub(crate) struct Points {
    /// From the source frame to the perturbed one.
    pub move_point: Function,
    /// Back; a script may do without, as long as no masks are moved.
    pub source_point: Option<Function>,
}

impl Points {
    /// Moves points.
    ///
    /// # Errors
    /// If the script has no function for this way, or it fails.
    pub(crate) fn apply(
        &self,
        (sandbox, script): (&Sandbox, &str),
        points: &mut [[f64; 2]],
        way: Way,
        [width, height]: [usize; 2],
        cx: &Table,
    ) -> Result<()> {
        let (name, function) = match (way, &self.source_point) {
            (Way::ToPerturbed, _) => ("move_point", &self.move_point),
            (Way::ToSource, Some(function)) => ("source_point", function),
            (Way::ToSource, None) => {
                return Err(Error::new(
                    "it does not say where a pixel comes from, which masks need; add source_point = function(x, y, width, height, cx) ... end",
                )
                .at(script));
            }
        };
        let chunk = sandbox.load("points", EACH)?;
        let Value::Function(each) = sandbox.call("points", &chunk, ())? else {
            return Err(Error::new("the loop over points cannot be made").at(script));
        };
        let bytes: Vec<u8> = points.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
        let buffer = sandbox.make(script, |lua| lua.create_buffer(bytes))?;
        sandbox
            .call(script, &each, (function, &buffer, width as f64, height as f64, cx))
            .place(format_args!("`{name}`"))?;
        sandbox.make(script, |lua| {
            let (data, length) = buffer_bytes(lua, &buffer)?;
            // SAFETY: these are the bytes of the buffer, which lives through the call, and no script runs meanwhile.
            let bytes = unsafe { std::slice::from_raw_parts(data, length) };
            for (number, bytes) in points.as_flattened_mut().iter_mut().zip(bytes.chunks_exact(8)) {
                *number = f64::from_le_bytes(bytes.try_into().unwrap_or_default());
            }
            Ok(())
        })
    }
}
