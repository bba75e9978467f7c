//! What is read out of MessagePack values, whose arrays may have more elements than we know of.

use rmpv::Value;

/// An element of an array; nil if there is none.
pub fn element(value: &Value, index: usize) -> &Value {
    value.as_array().and_then(|elements| elements.get(index)).unwrap_or(&Value::Nil)
}

/// The elements of an array; none if it is not an array.
pub fn elements(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// A number, whole or not.
pub fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.is_finite())
}

/// An id.
pub fn id(value: &Value) -> Option<u32> {
    value.as_u64().and_then(|id| u32::try_from(id).ok())
}

/// A text; empty if it is none.
pub fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// The bytes of a binary value; none if it is not a binary value.
pub fn bytes(value: &Value) -> &[u8] {
    value.as_slice().unwrap_or_default()
}

/// An array.
pub fn array(elements: impl Into<Vec<Value>>) -> Value {
    Value::Array(elements.into())
}

/// A number as CARLA has most of them: with 32 bits.
pub fn float(number: f64) -> Value {
    Value::F32(number as f32)
}

/// Three of them.
pub fn vector(numbers: [f64; 3]) -> Value {
    array(numbers.map(float))
}
