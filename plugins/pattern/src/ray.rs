//! Where a line starts and which way it runs.

use pdk_sdk::seed::Random;

/// A place in a frame and a direction of length 1, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub x: f64,
    pub y: f64,
    pub dx: f64,
    pub dy: f64,
}

impl Ray {
    /// Starts at a random pixel, in a random direction: that of a point in a square about the origin, so diagonals come
    /// up more often than the axes.
    pub fn draw(random: &mut Random, width: usize, height: usize) -> Self {
        let x = f64::from(random.below(width as u32));
        let y = f64::from(random.below(height as u32));
        let (dx, dy) = (random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
        let length = (dx * dx + dy * dy).sqrt();
        // The origin itself has no direction; one draw in 2^106 meets it.
        let (dx, dy) = if length > 0.0 { (dx / length, dy / length) } else { (1.0, 0.0) };
        Self { x, y, dx, dy }
    }

    /// The pixel it is at, where that lies inside the frame.
    pub fn pixel(&self, width: usize, height: usize) -> Option<(usize, usize)> {
        let inside = self.x >= 0.0 && self.y >= 0.0 && self.x < width as f64 && self.y < height as f64;
        inside.then_some((self.x as usize, self.y as usize))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;

    use super::Ray;

    #[test]
    fn starts_anywhere_inside_in_every_direction() {
        let mut random = Key([3; 32]).sequence();
        let rays: Vec<Ray> = (0..4000).map(|_| Ray::draw(&mut random, 7, 5)).collect();
        let mut hit = [false; 35];
        let mut quadrants = [0; 4];
        for ray in &rays {
            assert!((libm::hypot(ray.dx, ray.dy) - 1.0).abs() < 1e-12);
            let (x, y) = ray.pixel(7, 5).unwrap();
            hit[y * 7 + x] = true;
            quadrants[usize::from(ray.dx > 0.0) * 2 + usize::from(ray.dy > 0.0)] += 1;
        }
        assert!(hit.iter().all(|&h| h));
        assert!(quadrants.iter().all(|&q| (900..1100).contains(&q)), "{quadrants:?}");
    }

    #[test]
    fn a_place_outside_is_not_a_pixel() {
        let at = |x, y| Ray { x, y, dx: 1.0, dy: 0.0 }.pixel(7, 5);
        assert_eq!(at(6.9, 4.9), Some((6, 4)));
        for (x, y) in [(-0.1, 0.0), (0.0, -0.1), (7.0, 0.0), (0.0, 5.0), (f64::NAN, 0.0)] {
            assert_eq!(at(x, y), None);
        }
    }
}
