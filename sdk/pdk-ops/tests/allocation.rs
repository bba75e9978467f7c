//! After the first frame of a size, kernels allocate nothing.

mod counting;

use pdk_ops::{
    FrameBuf, average, blend, canny, color, draw, equalise, false_color, fog, gaussian, hsv, jpeg, light,
    low_pass, noise, phase, point, poisson, posterize, resize, saturation, scatter, sensor, white_balance,
    zoom,
};
use pdk_seed::Key;

#[test]
fn kernels_allocate_on_the_first_frame_only() {
    let src = FrameBuf::from_vec((0..=255).cycle().take(65 * 40 * 3).collect(), 65, 40).unwrap();
    let other = FrameBuf::new(33, 21);
    let mut dst = FrameBuf::new(65, 40);
    let mut smoothing = gaussian::Workspace::default();
    let mut averages = average::Workspace::default();
    let mut table = poisson::PoissonTable::new(30.0);
    let mut compression = jpeg::Workspace::default();
    let (curve, counting) = (light::Light::new(), sensor::Sensor { white: 900.0, read: 3.0 });
    let (mut zooms, mut places) = (zoom::Workspace::default(), scatter::Workspace::default());
    let (mut smooth_value, mut field, mut grain) =
        (low_pass::Workspace::default(), fog::Field::default(), fog::Grain::default());
    let (mut edges, mut curves, mut spectra) =
        (canny::Workspace::default(), equalise::Workspace::default(), phase::Workspace::default());
    let mut all = |frame: u64| {
        let src = src.as_ref();
        let random = || Key([1; 32]).frame(frame);
        point::lookup(src, dst.as_mut(), &[7; 256]);
        sensor::expose(&curve, src, dst.as_mut(), counting, &mut random(), |_| 0.5);
        point::scale_about(src, dst.as_mut(), 127.5, 1.5);
        blend::blend(src, 0.5, src, dst.as_mut());
        blend::blend_with_grey(src, dst.as_mut(), 0.5);
        color::grayscale(src, dst.as_mut());
        hsv::scale_hsv(src, dst.as_mut(), 1.0, 1.5);
        resize::resize_linear(other.as_ref(), dst.as_mut());
        gaussian::gaussian_blur(src, dst.as_mut(), 25 - 2 * (frame % 2) as usize, &mut smoothing);
        average::disc_blur(src, dst.as_mut(), 9.0 - (frame % 2) as f64, &mut averages);
        average::pixel_average(src, dst.as_mut(), &[(0, 0), (3, -2)], &mut averages);
        jpeg::jpeg(src, dst.as_mut(), 5.0 + frame as f64, jpeg::ChannelOrder::Bgr, &mut compression);
        zoom::zoom_blur(
            src,
            dst.as_mut(),
            12.0 - (frame % 2) as f64,
            0.02,
            zoom::Enlargement::WholePixels,
            &mut zooms,
        );
        scatter::scatter(src, dst.as_mut(), 3.0, Key([frame as u8; 32]), &mut places);
        low_pass::low_pass(src, dst.as_mut(), 41 - 2 * (frame % 2) as usize, &mut smooth_value);
        canny::blend_with_edges(src, dst.as_mut(), 0.3, (50.0 - 10.0 * frame as f64, 150.0), &mut edges);
        equalise::equalise_value(src, dst.as_mut(), 1.0 + frame as f64, &mut curves);
        phase::scramble_phase(src, dst.as_mut(), 0.1 * frame as f64, &mut random(), &mut spectra);
        false_color::false_color(src, dst.as_mut(), 0.7 * frame as f64, false_color::Sums::Wrapped);
        posterize::posterize(src, dst.as_mut(), 9.0, 30.0);
        saturation::scale_saturation(src, dst.as_mut(), 1.5);
        white_balance::blend_with_grey_world(src, dst.as_mut(), 0.5);
        field.frame(65, 40, Key([frame as u8; 32]));
        grain.frame(65, 40, 0.1 * frame as f64, fog::Overflow::Clips, &mut random());
        noise::gaussian_noise(src, dst.as_mut(), 0.1, &mut random());
        noise::speckle_noise(src, dst.as_mut(), 0.1, &mut random());
        noise::impulse_noise(src, dst.as_mut(), 0.1, noise::Impulses::Published, &mut random());
        table.set_count(30.0 + frame as f64);
        poisson::poisson_noise(src, dst.as_mut(), &table, &mut random());
        draw::fill_circle(dst.as_mut(), 20.0, 20.0, 9.0, [1, 2, 3]);
        draw::fill_rectangle(dst.as_mut(), 3, 4, 5, 6, [1, 2, 3]);
        draw::draw_line(dst.as_mut(), 3, 4, 50, 6, [1, 2, 3]);
    };
    let count = |work: &mut dyn FnMut()| {
        let before = counting::count();
        work();
        counting::count() - before
    };
    assert!(count(&mut || all(0)) > 0, "the counter does not count");
    for frame in 1..5 {
        assert_eq!(count(&mut || all(frame)), 0, "frame {frame}");
    }
}
