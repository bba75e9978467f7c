//! Times of the kernels on one thread, at 320x240 and the slowest published level, with a copy as the yardstick.
//! `cargo bench -p pdk-ops`

use divan::Bencher;
use pdk_ops::{
    Frame, FrameBuf, FrameMut, average, blend, canny, color, elastic, equalise, false_color, gaussian, hsv,
    jpeg, noise, overlay, phase, point, poisson, posterize, resample, resize, saturation, sharpen, unsharp,
    warp, white_balance, yuv,
};
use pdk_seed::Key;

fn main() {
    divan::main();
}

/// A frame with smooth parts, edges and grain.
fn scene(width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    let mut random = Key([3; 32]).sequence();
    let mut view = frame.as_mut();
    for y in 0..height {
        for x in 0..width {
            let base = [x * 255 / width, y * 255 / height, (x / 16 + y / 16) % 2 * 200];
            view.set_pixel(x, y, base.map(|v| (v as i32 + random.between(-8, 8)).clamp(0, 255) as u8));
        }
    }
    frame
}

fn time(bencher: Bencher<'_, '_>, mut kernel: impl FnMut(Frame<'_>, FrameMut<'_>)) {
    let (src, mut dst) = (scene(320, 240), FrameBuf::new(320, 240));
    kernel(src.as_ref(), dst.as_mut());
    bencher.bench_local(|| kernel(divan::black_box(src.as_ref()), dst.as_mut()));
}

#[divan::bench]
fn copy(bencher: Bencher<'_, '_>) {
    time(bencher, |src, mut dst| dst.copy_from(src));
}

#[divan::bench]
fn lookup(bencher: Bencher<'_, '_>) {
    let table: [u8; 256] = std::array::from_fn(|v| 255 - v as u8);
    time(bencher, |src, dst| point::lookup(src, dst, &table));
}

#[divan::bench]
fn contrast(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| point::scale_about(src, dst, 127.5, 1.7));
}

#[divan::bench]
fn blend_two(bencher: Bencher<'_, '_>) {
    let other = scene(320, 240);
    time(bencher, |src, dst| blend::blend(src, 0.3, other.as_ref(), dst));
}

#[divan::bench]
fn overlay_everywhere(bencher: Bencher<'_, '_>) {
    let picture = scene(320, 240);
    let alphas: Vec<u8> =
        picture.data().chunks_exact(3).map(|pixel| pixel[0].max(pixel[1]).max(pixel[2])).collect();
    time(bencher, |src, dst| overlay::overlay(src, dst, picture.data(), &alphas, 0.8));
}

#[divan::bench]
fn rgb_to_video(bencher: Bencher<'_, '_>) {
    let [mut luma, mut blue, mut red] = [320 * 240, 160 * 120, 160 * 120].map(|size| vec![0; size]);
    time(bencher, |src, _| yuv::from_rgb(src, [&mut luma, &mut blue, &mut red]));
}

#[divan::bench]
fn video_to_rgb(bencher: Bencher<'_, '_>) {
    let picture = scene(320, 240);
    let (luma, rest) = picture.data().split_at(320 * 240);
    let (blue, rest) = rest.split_at(160 * 120);
    time(bencher, |_, dst| yuv::to_rgb([luma, blue, &rest[..160 * 120]], dst));
}

#[divan::bench]
fn grayscale(bencher: Bencher<'_, '_>) {
    time(bencher, color::grayscale);
}

#[divan::bench]
fn blend_with_grey(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| blend::blend_with_grey(src, dst, 0.85));
}

#[divan::bench]
fn increase_brightness(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| hsv::scale_hsv(src, dst, 1.0, 1.7));
}

#[divan::bench]
fn gaussian_noise(bencher: Bencher<'_, '_>) {
    let mut random = Key::default().frame(0);
    time(bencher, |src, dst| noise::gaussian_noise(src, dst, 0.22, &mut random));
}

#[divan::bench]
fn speckle_noise(bencher: Bencher<'_, '_>) {
    let mut random = Key::default().frame(0);
    time(bencher, |src, dst| noise::speckle_noise(src, dst, 0.2, &mut random));
}

#[divan::bench]
fn random_bytes(bencher: Bencher<'_, '_>) {
    let mut random = Key::default().frame(0);
    let mut bytes = vec![0; 320 * 240 * 3 * 2];
    bencher.bench_local(|| random.fill(&mut bytes));
}

#[divan::bench]
fn poisson_noise(bencher: Bencher<'_, '_>) {
    let mut random = Key::default().frame(0);
    let table = poisson::PoissonTable::new(30.0);
    time(bencher, |src, dst| poisson::poisson_noise(src, dst, &table, &mut random));
}

#[divan::bench]
fn poisson_table(bencher: Bencher<'_, '_>) {
    let mut table = poisson::PoissonTable::new(30.0);
    let mut count = 120.0;
    bencher.bench_local(|| {
        count = 240.5 - count;
        table.set_count(count);
    });
}

#[divan::bench]
fn impulse_noise(bencher: Bencher<'_, '_>) {
    let mut random = Key::default().frame(0);
    time(bencher, |src, dst| noise::impulse_noise(src, dst, 0.1, noise::Impulses::Published, &mut random));
}

#[divan::bench]
fn gaussian_blur_41(bencher: Bencher<'_, '_>) {
    let mut workspace = gaussian::Workspace::default();
    time(bencher, |src, dst| gaussian::gaussian_blur(src, dst, 41, &mut workspace));
}

#[divan::bench]
fn disc_blur_12(bencher: Bencher<'_, '_>) {
    let mut workspace = average::Workspace::default();
    time(bencher, |src, dst| average::disc_blur(src, dst, 12.0, &mut workspace));
}

#[divan::bench]
fn pixel_average_15(bencher: Bencher<'_, '_>) {
    let mut workspace = average::Workspace::default();
    let neighbours: Vec<_> = (-7..=7).map(|i| (i, i)).collect();
    time(bencher, |src, dst| average::pixel_average(src, dst, &neighbours, &mut workspace));
}

#[divan::bench]
fn resize_linear_from_half(bencher: Bencher<'_, '_>) {
    let half = scene(160, 120);
    time(bencher, |_, dst| resize::resize_linear(half.as_ref(), dst));
}

#[divan::bench]
fn jpeg_quality_5(bencher: Bencher<'_, '_>) {
    let mut workspace = jpeg::Workspace::default();
    time(bencher, |src, dst| jpeg::jpeg(src, dst, 5.0, jpeg::ChannelOrder::Bgr, &mut workspace));
}

#[divan::bench]
fn false_color(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| false_color::false_color(src, dst, 4.0, false_color::Sums::Wrapped));
}

#[divan::bench]
fn false_color_blended(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| false_color::false_color(src, dst, 3.5, false_color::Sums::Wrapped));
}

#[divan::bench]
fn posterize_4(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| posterize::posterize(src, dst, 4.0, 85.0));
}

#[divan::bench]
fn white_balance(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| white_balance::blend_with_grey_world(src, dst, 0.99));
}

#[divan::bench]
fn saturation(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| saturation::scale_saturation(src, dst, 1.9));
}

#[divan::bench]
fn low_pass_41(bencher: Bencher<'_, '_>) {
    let mut workspace = pdk_ops::low_pass::Workspace::default();
    time(bencher, |src, dst| pdk_ops::low_pass::low_pass(src, dst, 41, &mut workspace));
}

#[divan::bench]
fn scatter_12(bencher: Bencher<'_, '_>) {
    let mut workspace = pdk_ops::scatter::Workspace::default();
    time(bencher, |src, dst| pdk_ops::scatter::scatter(src, dst, 12.0, Key::default(), &mut workspace));
}

#[divan::bench]
fn scatter_12_with_new_places(bencher: Bencher<'_, '_>) {
    let mut workspace = pdk_ops::scatter::Workspace::default();
    let mut key = Key::default();
    time(bencher, |src, dst| {
        key.0[0] = key.0[0].wrapping_add(1);
        pdk_ops::scatter::scatter(src, dst, 12.0, key, &mut workspace);
    });
}

#[divan::bench]
fn histogram_equalisation(bencher: Bencher<'_, '_>) {
    let mut workspace = equalise::Workspace::default();
    time(bencher, |src, dst| equalise::equalise_value(src, dst, 10.0, &mut workspace));
}

#[divan::bench]
fn zoom_blur_11(bencher: Bencher<'_, '_>) {
    let mut workspace = pdk_ops::zoom::Workspace::default();
    time(bencher, |src, dst| {
        pdk_ops::zoom::zoom_blur(
            src,
            dst,
            11.0,
            0.03,
            pdk_ops::zoom::Enlargement::WholePixels,
            &mut workspace,
        )
    });
}

#[divan::bench]
fn canny_edges(bencher: Bencher<'_, '_>) {
    let mut workspace = canny::Workspace::default();
    time(bencher, |src, dst| canny::blend_with_edges(src, dst, 0.3, (51.0, 151.0), &mut workspace));
}

#[divan::bench]
fn rotate_45(bencher: Bencher<'_, '_>) {
    let mut workspace = warp::Workspace::default();
    let map = warp::Affine::rotation(45.0, 160.0, 120.0);
    time(bencher, |src, dst| warp::warp_affine(src, dst, &map, &mut workspace));
}

#[divan::bench]
fn rotate_180(bencher: Bencher<'_, '_>) {
    let mut workspace = warp::Workspace::default();
    let map = warp::Affine::rotation(180.0, 160.0, 120.0);
    time(bencher, |src, dst| warp::warp_affine(src, dst, &map, &mut workspace));
}

#[divan::bench]
fn shear(bencher: Bencher<'_, '_>) {
    let mut workspace = warp::Workspace::default();
    let map = warp::Affine::shear(0.12);
    time(bencher, |src, dst| warp::warp_affine(src, dst, &map, &mut workspace));
}

#[divan::bench]
fn translate_by_a_tenth(bencher: Bencher<'_, '_>) {
    let mut workspace = warp::Workspace::default();
    let map = warp::Affine::translation(-0.1, 0.1);
    time(bencher, |src, dst| warp::warp_affine(src, dst, &map, &mut workspace));
}

#[divan::bench]
fn scale_96(bencher: Bencher<'_, '_>) {
    let mut small = FrameBuf::new(307, 230);
    time(bencher, |src, _| resize::resize_linear(src, small.as_mut()));
}

#[divan::bench]
fn pixelate_85(bencher: Bencher<'_, '_>) {
    let mut small = FrameBuf::new(272, 204);
    time(bencher, |src, dst| {
        resize::resize_linear(src, small.as_mut());
        resize::resize_linear(small.as_ref(), dst);
    });
}

#[divan::bench]
fn pixelate_85_by_areas(bencher: Bencher<'_, '_>) {
    let mut small = FrameBuf::new(272, 204);
    let mut workspace = resample::Workspace::default();
    time(bencher, |src, dst| {
        resample::resize_area(src, small.as_mut(), &mut workspace);
        resample::resize_nearest(small.as_ref(), dst);
    });
}

#[divan::bench]
fn reflection_90(bencher: Bencher<'_, '_>) {
    time(bencher, |src, dst| {
        let row = |y: usize| src.row(if y < 240 { y } else { 479 - y });
        resize::resize_linear_from(resize::Source { width: 320, height: 456, row: &row }, dst);
    });
}

#[divan::bench]
fn sharpen(bencher: Bencher<'_, '_>) {
    let mut workspace = sharpen::Workspace::default();
    time(bencher, |src, dst| sharpen::sharpen(src, dst, 5.0, 0.5, &mut workspace));
}

#[divan::bench]
fn unsharp_mask_113(bencher: Bencher<'_, '_>) {
    let mut workspace = unsharp::Workspace::default();
    time(bencher, |src, dst| unsharp::unsharp_mask(src, dst, 113, &mut workspace));
}

#[divan::bench]
fn elastic_10(bencher: Bencher<'_, '_>) {
    let mut workspace = elastic::Workspace::default();
    let mut random = Key::default().frame(0);
    time(bencher, |src, dst| elastic::elastic(src, dst, 10.0, 1.5, &mut random, &mut workspace));
}

#[divan::bench]
fn fog_field(bencher: Bencher<'_, '_>) {
    let mut field = pdk_ops::fog::Field::default();
    time(bencher, |src, dst| blend::blend(src, 0.4, field.frame(320, 240, Key::default()), dst));
}

#[divan::bench]
fn fog_field_of_a_new_sequence(bencher: Bencher<'_, '_>) {
    let mut field = pdk_ops::fog::Field::default();
    let mut key = Key::default();
    time(bencher, |src, dst| {
        key.0[0] = key.0[0].wrapping_add(1);
        blend::blend(src, 0.4, field.frame(320, 240, key), dst);
    });
}

#[divan::bench]
fn fog_grain(bencher: Bencher<'_, '_>) {
    let mut grain = pdk_ops::fog::Grain::default();
    let mut random = Key::default().frame(0);
    time(bencher, |src, dst| {
        let fog = grain.frame(320, 240, 0.45, pdk_ops::fog::Overflow::Wraps, &mut random);
        blend::blend(src, 0.35, fog, dst);
    });
}

#[divan::bench]
fn phase_scrambling(bencher: Bencher<'_, '_>) {
    let mut workspace = phase::Workspace::default();
    let mut random = Key::default().frame(0);
    time(bencher, |src, dst| phase::scramble_phase(src, dst, 0.55, &mut random, &mut workspace));
}

#[divan::bench]
fn lay_over_and_scale_saturation(bencher: Bencher<'_, '_>) {
    let (texture, cover, mut covered) = (scene(320, 240), scene(320, 240), scene(320, 240));
    time(bencher, |src, dst| {
        pdk_ops::layer::lay_over(src, texture.as_ref(), cover.as_ref(), 0.6, covered.as_mut());
        hsv::scale_hsv(covered.as_ref(), dst, 0.8, 1.0);
    });
}
