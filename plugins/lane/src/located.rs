//! Asks the field for rows of places at once.

#[cfg(target_arch = "x86_64")]
use crate::field::{CELLS, CORNERS, EMPTY, SHIFT, TILE};
use crate::field::{Field, Place};
#[cfg(target_arch = "x86_64")]
use crate::simd::{BLOCK, avx2::Pairs, has_avx2, has_avx512};

/// Where places lie relative to the lane, one value for each in each row; see [`Place`]. If the road is far, `lateral` is
/// infinite and nothing else is known.
pub struct Located<'a> {
    pub lateral: &'a mut [f32],
    pub along: &'a mut [f32],
    pub gradient: [&'a mut [f32]; 2],
    pub shade: &'a mut [f32],
}

impl Located<'_> {
    fn set(&mut self, i: usize, place: Option<Place>) {
        let far = Place { lateral: f32::INFINITY, along: 0.0, gradient: [0.0; 2], shade: 0.0 };
        let place = place.unwrap_or(far);
        (self.lateral[i], self.along[i], self.shade[i]) = (place.lateral, place.along, place.shade);
        (self.gradient[0][i], self.gradient[1][i]) = (place.gradient[0], place.gradient[1]);
    }
}

impl Field {
    /// As [`Field::at`] for whole blocks of places.
    pub fn locate(&self, x: &[f32], z: &[f32], mut into: Located<'_>) {
        #[cfg(target_arch = "x86_64")]
        if has_avx512() && !self.corners.is_empty() {
            // SAFETY: the processor has all that this version asks for.
            return unsafe { self.locate_avx512(x, z, into) };
        }
        #[cfg(target_arch = "x86_64")]
        if has_avx2() && !self.corners.is_empty() {
            // SAFETY: the processor has AVX2, which is all that this version asks for.
            return unsafe { self.locate_avx2(x, z, into) };
        }
        for (i, (x, z)) in x.iter().zip(z).enumerate() {
            into.set(i, self.at(*x, *z));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn locate_avx2(&self, x: &[f32], z: &[f32], into: Located<'_>) {
        use std::arch::x86_64::*;

        use crate::simd::avx2::{load, look_up, mix, store};

        let (set, number) = (|value: f32| _mm256_set1_ps(value), |value: i32| _mm256_set1_epi32(value));
        let minus = |a, b| _mm256_sub_ps(a, b);
        let without_sign = |value| _mm256_and_ps(value, _mm256_castsi256_ps(number(i32::MAX)));
        let below = |a, b| _mm256_cmp_ps::<_CMP_LT_OQ>(a, b);
        let not_below = |a, b| _mm256_cmp_ps::<_CMP_GE_OQ>(a, b);
        let bounds = (set((self.columns * TILE) as f32), set((self.rows * TILE) as f32));
        let pairs = Pairs::new(&self.corners);

        let [gx, gz] = into.gradient.map(|values| values.as_chunks_mut::<BLOCK>().0);
        let [lateral, along, shade] =
            [into.lateral, into.along, into.shade].map(|values| values.as_chunks_mut::<BLOCK>().0);
        let (x, z) = (x.as_chunks::<BLOCK>().0, z.as_chunks::<BLOCK>().0);
        for i in 0..x.len().min(z.len()) {
            let cx = _mm256_mul_ps(load(&x[i]), set(CELLS));
            let cz = _mm256_mul_ps(load(&z[i]), set(CELLS));
            let inside = _mm256_and_ps(
                _mm256_and_ps(not_below(cx, set(0.0)), not_below(cz, set(0.0))),
                _mm256_and_ps(below(cx, bounds.0), below(cz, bounds.1)),
            );
            // What lies outside is looked up in the corner of the map, and the result not used.
            let column = _mm256_cvttps_epi32(_mm256_and_ps(cx, inside));
            let row = _mm256_cvttps_epi32(_mm256_and_ps(cz, inside));
            let tile = _mm256_add_epi32(
                _mm256_mullo_epi32(_mm256_srli_epi32::<{ SHIFT as i32 }>(row), number(self.columns as i32)),
                _mm256_srli_epi32::<{ SHIFT as i32 }>(column),
            );
            // SAFETY: rows and columns are those of the map.
            let tile = unsafe { _mm256_i32gather_epi32::<4>(self.tiles.as_ptr().cast(), tile) };
            let empty = _mm256_cmpeq_epi32(tile, number(EMPTY as i32));
            let tile = _mm256_andnot_si256(empty, tile);
            let within = number(TILE as i32 - 1);
            let first = _mm256_add_epi32(
                _mm256_mullo_epi32(tile, number((CORNERS * CORNERS) as i32)),
                _mm256_add_epi32(
                    _mm256_mullo_epi32(_mm256_and_si256(row, within), number(CORNERS as i32)),
                    _mm256_and_si256(column, within),
                ),
            );
            let behind = _mm256_add_epi32(first, number(CORNERS as i32));
            let (fx, fz) = (minus(cx, _mm256_cvtepi32_ps(column)), minus(cz, _mm256_cvtepi32_ps(row)));

            let [lateral_a, along_a, lateral_b, along_b] = look_up!(pairs, first);
            let [lateral_c, along_c, lateral_d, along_d] = look_up!(pairs, behind);
            let (across_near, across_far) = (minus(lateral_b, lateral_a), minus(lateral_d, lateral_c));
            let (lateral_near, lateral_far) = (mix(lateral_a, lateral_b, fx), mix(lateral_c, lateral_d, fx));
            let (along_near, along_far) = (mix(along_a, along_b, fx), mix(along_c, along_d, fx));
            let across = _mm256_mul_ps(mix(across_near, across_far, fz), set(CELLS));
            let ahead = _mm256_mul_ps(minus(lateral_far, lateral_near), set(CELLS));
            let change = _mm256_add_ps(without_sign(across), without_sign(ahead));
            // If it changes faster, it is unknown, as in `at`.
            let torn = _mm256_cmp_ps::<_CMP_GT_OQ>(change, set(2.0));
            let known = _mm256_andnot_ps(_mm256_or_ps(_mm256_castsi256_ps(empty), torn), inside);
            let or_zero = |value| _mm256_and_ps(value, known);
            let found = mix(lateral_near, lateral_far, fz);
            store(&mut lateral[i], _mm256_blendv_ps(set(f32::INFINITY), found, known));
            store(&mut along[i], or_zero(mix(along_near, along_far, fz)));
            store(&mut gx[i], or_zero(across));
            store(&mut gz[i], or_zero(ahead));
            let taken = if self.shades.is_empty() {
                set(0.0)
            } else {
                // SAFETY: there is a shade for each corner, and the corners of a cell lie in one tile.
                let shade = |place, more: i32| unsafe {
                    _mm256_i32gather_ps::<4>(self.shades.as_ptr(), _mm256_add_epi32(place, number(more)))
                };
                let near = mix(shade(first, 0), shade(first, 1), fx);
                let far = mix(shade(behind, 0), shade(behind, 1), fx);
                mix(near, far, fz)
            };
            store(&mut shade[i], or_zero(taken));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    fn locate_avx512(&self, x: &[f32], z: &[f32], into: Located<'_>) {
        use std::arch::x86_64::*;

        use crate::simd::avx512::{LANES, lanes, load, look_up, mix, store};

        let (set, number) = (|value: f32| _mm512_set1_ps(value), |value: i32| _mm512_set1_epi32(value));
        let minus = |a, b| _mm512_sub_ps(a, b);
        let bounds = (set((self.columns * TILE) as f32), set((self.rows * TILE) as f32));
        let corners = self.corners.as_flattened();

        let [gx, gz] = into.gradient.map(|values| values.chunks_mut(LANES));
        let [lateral, along, shade] =
            [into.lateral, into.along, into.shade].map(|values| values.chunks_mut(LANES));
        let places = x.chunks(LANES).zip(z.chunks(LANES));
        let rows = lateral.zip(along).zip(shade).zip(gx.zip(gz));
        for ((x, z), (((lateral, along), shade), (gx, gz))) in places.zip(rows) {
            let asked = lanes(x.len().min(z.len()));
            let cx = _mm512_mul_ps(load(x), set(CELLS));
            let cz = _mm512_mul_ps(load(z), set(CELLS));
            let inside = asked
                & _mm512_cmp_ps_mask::<_CMP_GE_OQ>(cx, set(0.0))
                & _mm512_cmp_ps_mask::<_CMP_GE_OQ>(cz, set(0.0))
                & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(cx, bounds.0)
                & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(cz, bounds.1);
            // What lies outside is looked up in the corner of the map, and the result not used.
            let column = _mm512_maskz_cvttps_epi32(inside, cx);
            let row = _mm512_maskz_cvttps_epi32(inside, cz);
            let tile = _mm512_add_epi32(
                _mm512_mullo_epi32(_mm512_srli_epi32::<{ SHIFT as u32 }>(row), number(self.columns as i32)),
                _mm512_srli_epi32::<{ SHIFT as u32 }>(column),
            );
            let nowhere = number(EMPTY as i32);
            // SAFETY: rows and columns are those of the map, and what lies outside is not read.
            let tile = unsafe {
                _mm512_mask_i32gather_epi32::<4>(nowhere, inside, tile, self.tiles.as_ptr().cast())
            };
            let stored = _mm512_cmpneq_epi32_mask(tile, nowhere);
            if stored == 0 {
                store(lateral, !0, set(f32::INFINITY));
                for values in [along, gx, gz, shade] {
                    store(values, !0, set(0.0));
                }
                continue;
            }
            let tile = _mm512_maskz_mov_epi32(stored, tile);
            let within = number(TILE as i32 - 1);
            let first = _mm512_add_epi32(
                _mm512_mullo_epi32(tile, number((CORNERS * CORNERS) as i32)),
                _mm512_add_epi32(
                    _mm512_mullo_epi32(_mm512_and_si512(row, within), number(CORNERS as i32)),
                    _mm512_and_si512(column, within),
                ),
            );
            let behind = _mm512_add_epi32(first, number(CORNERS as i32));
            let (fx, fz) = (minus(cx, _mm512_cvtepi32_ps(column)), minus(cz, _mm512_cvtepi32_ps(row)));

            let [lateral_a, along_a, lateral_b, along_b] = look_up!(corners, 2, first);
            let [lateral_c, along_c, lateral_d, along_d] = look_up!(corners, 2, behind);
            let (across_near, across_far) = (minus(lateral_b, lateral_a), minus(lateral_d, lateral_c));
            let (lateral_near, lateral_far) = (mix(lateral_a, lateral_b, fx), mix(lateral_c, lateral_d, fx));
            let (along_near, along_far) = (mix(along_a, along_b, fx), mix(along_c, along_d, fx));
            let across = _mm512_mul_ps(mix(across_near, across_far, fz), set(CELLS));
            let ahead = _mm512_mul_ps(minus(lateral_far, lateral_near), set(CELLS));
            let change = _mm512_add_ps(_mm512_abs_ps(across), _mm512_abs_ps(ahead));
            // If it changes faster, it is unknown, as in `at`.
            let torn = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(change, set(2.0));
            let known = stored & !torn;
            let or_zero = |value| _mm512_maskz_mov_ps(known, value);
            let found = mix(lateral_near, lateral_far, fz);
            store(lateral, !0, _mm512_mask_mov_ps(set(f32::INFINITY), known, found));
            store(along, !0, or_zero(mix(along_near, along_far, fz)));
            store(gx, !0, or_zero(across));
            store(gz, !0, or_zero(ahead));
            let taken = if self.shades.is_empty() {
                set(0.0)
            } else {
                // SAFETY: there is a shade for each corner, and the corners of a cell lie in one tile.
                let shade = |place, more: i32| unsafe {
                    _mm512_i32gather_ps::<4>(_mm512_add_epi32(place, number(more)), self.shades.as_ptr())
                };
                let near = mix(shade(first, 0), shade(first, 1), fx);
                let far = mix(shade(behind, 0), shade(behind, 1), fx);
                mix(near, far, fz)
            };
            store(shade, !0, or_zero(taken));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Road;
    use crate::simd::portably;

    #[test]
    fn blocks_are_their_places_one_by_one_on_every_processor() {
        let road = Road::from_angles(&[0.0, 0.0, 60.0, 60.0, 60.0, 0.0, 0.0], &[20.0; 7], &[]).unwrap();
        let mut field = Field::new(&road.path);
        let count = 4008;
        let x: Vec<f32> = (0..count).map(|i| (i * 7919 % 1601) as f32 * 0.11 - 20.0).collect();
        let mut z: Vec<f32> = (0..count).map(|i| (i * 6007 % 1999) as f32 * 0.09 - 20.0).collect();
        (z[5], z[6], z[7]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY);
        for shaded in [false, true] {
            if shaded {
                field.cast(road.path.point_at(40.0), 15.0, |at| (at[0] as f32 * 0.37).fract().abs());
            }
            let located = || {
                let mut values: [Vec<f32>; 5] = std::array::from_fn(|_| vec![f32::NAN; count]);
                let [lateral, along, gx, gz, shade] = values.each_mut().map(Vec::as_mut_slice);
                field.locate(&x, &z, Located { lateral, along, gradient: [gx, gz], shade });
                values
            };
            let values = located();
            assert_eq!(values, portably(located));
            let mut near = 0;
            for i in 0..count {
                let mut place = [f32::INFINITY, 0.0, 0.0, 0.0, 0.0];
                if let Some(Place { lateral, along, gradient: [gx, gz], shade }) = field.at(x[i], z[i]) {
                    place = [lateral, along, gx, gz, shade];
                    near += 1;
                }
                let found = [0, 1, 2, 3, 4].map(|k| values[k][i].to_bits());
                assert_eq!(found, place.map(f32::to_bits), "{i}");
            }
            assert!(near > 1000, "{near}");
        }
    }
}
