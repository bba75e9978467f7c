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

/// What a change adds to a byte of a frame: at most `epsilon`, rounded down.
pub fn step(change: f32, epsilon: f32) -> i16 {
    let limit = epsilon.floor();
    (change * epsilon).round_ties_even().clamp(-limit, limit) as i16
}

/// A byte of a frame with something added.
pub fn added(byte: u8, step: i16) -> u8 {
    (i16::from(byte) + step).clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_stand_for_changes_and_what_is_added_is_limited() {
        assert_eq!([-1.0, 0.0, 0.5, 1.0].map(byte), [1, 128, 192, 255]);
        assert!((0..=255).all(|at| byte(of_byte(at)) == at));
        // The lowest byte is a little beyond -1.
        assert_eq!([0, 1, 128, 255].map(|at| added(100, step(of_byte(at), 16.0))), [84, 84, 100, 116]);
        assert_eq!([1, 255].map(|at| added(100, step(of_byte(at), 1.5))), [99, 101]);
        assert_eq!((added(250, step(1.0, 16.0)), added(3, step(-1.0, 16.0))), (255, 0));
    }
}
