//! Smooth noise that repeats: in space after a whole number of cells, and in time after one clip.

use pdk_seed::Random;

/// Random values on a lattice that closes in all three directions, interpolated smoothly. Values lie in -1 to 1.
pub struct Lattice {
    size: [usize; 3],
    values: Vec<f32>,
}

impl Lattice {
    /// A lattice of `size` cells: across, down, in time.
    pub fn new(size: [usize; 3], random: &mut Random) -> Self {
        let count = size.iter().product();
        Self { size, values: (0..count).map(|_| random.uniform(-1.0, 1.0) as f32).collect() }
    }

    /// The value at a place, in cells.
    pub fn at(&self, place: [f32; 3]) -> f32 {
        let mut cells = [[0; 2]; 3];
        let mut shares = [0.0; 3];
        for axis in 0..3 {
            let cell = place[axis].floor();
            let t = place[axis] - cell;
            shares[axis] = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
            let size = self.size[axis] as i64;
            cells[axis] = [0, 1].map(|next| (cell as i64 + next).rem_euclid(size) as usize);
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = 0;
            for axis in (0..3).rev() {
                let far = corner >> axis & 1;
                weight *= if far == 1 { shares[axis] } else { 1.0 - shares[axis] };
                index = index * self.size[axis] + cells[axis][far];
            }
            sum += weight * self.values[index];
        }
        sum
    }
}

/// Noise at several scales, each half as large and half as strong as the one before.
pub struct Turbulence {
    octaves: Vec<Lattice>,
    cells: [usize; 3],
}

impl Turbulence {
    /// Noise whose largest scale has `cells` cells in the clip.
    pub fn new(cells: [usize; 3], octaves: u32, random: &mut Random) -> Self {
        let lattice = |octave: u32| {
            Lattice::new([cells[0] << octave, cells[1] << octave, cells[2] << octave.min(2)], random)
        };
        Self { octaves: (0..octaves).map(lattice).collect(), cells }
    }

    /// The value at a place, each of whose coordinates runs from 0 to 1 and then repeats; about -1 to 1.
    pub fn at(&self, place: [f32; 3]) -> f32 {
        let mut sum = 0.0;
        let mut strength = 0.6;
        for (octave, lattice) in self.octaves.iter().enumerate() {
            let scale = [octave, octave, octave.min(2)];
            let place = [0, 1, 2].map(|axis| place[axis] * (self.cells[axis] << scale[axis]) as f32);
            sum += strength * lattice.at(place);
            strength *= 0.5;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_seed::Key;

    #[test]
    fn noise_repeats_and_is_smooth() {
        let noise = Turbulence::new([3, 2, 4], 4, &mut Key([1; 32]).sequence());
        let (mut least, mut most) = (f32::MAX, f32::MIN);
        for i in 0..500 {
            let place = [i as f32 * 0.0371, i as f32 * 0.0193, i as f32 * 0.0051];
            let value = noise.at(place);
            for axis in 0..3 {
                let (mut round, mut near) = (place, place);
                round[axis] += 1.0;
                near[axis] += 1e-4;
                assert!((noise.at(round) - value).abs() < 1e-2);
                assert!((noise.at(near) - value).abs() < 2e-2);
            }
            (least, most) = (least.min(value), most.max(value));
        }
        assert!(least < -0.4 && most > 0.4, "{least} {most}");
    }
}
