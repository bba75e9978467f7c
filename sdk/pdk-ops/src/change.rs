//! Changes of frames as pictures: a byte of such a picture stands for a change from -1 to 1, which is scaled and added to a byte of a frame.

/// The byte that stands for no change, and how many bytes away the largest change is.
const NONE: f32 = 128.0;
const MOST: f32 = 127.0;

/// The byte that stands for a change from -1 to 1.
pub fn byte(change: f32) -> u8 {
    (NONE + MOST * change).round_ties_even() as u8
}

/// The change that a byte stands for.
pub fn of_byte(byte: u8) -> f32 {
    (f32::from(byte) - NONE) / MOST
}

/// A byte of a frame with a change of it, which is at most `epsilon`, rounded down.
pub fn added(byte: u8, change: f32, epsilon: f32) -> u8 {
    let limit = epsilon.floor();
    (f32::from(byte) + (change * epsilon).round_ties_even().clamp(-limit, limit)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_stand_for_changes_and_what_is_added_is_limited() {
        assert_eq!([-1.0, 0.0, 0.5, 1.0].map(byte), [1, 128, 192, 255]);
        assert!((0..=255).all(|at| byte(of_byte(at)) == at));
        // The lowest byte is a little beyond -1.
        assert_eq!([0, 1, 128, 255].map(|at| added(100, of_byte(at), 16.0)), [84, 84, 100, 116]);
        assert_eq!([1, 255].map(|at| added(100, of_byte(at), 1.5)), [99, 101]);
        assert_eq!((added(250, 1.0, 16.0), added(3, -1.0, 16.0)), (255, 0));
    }
}
