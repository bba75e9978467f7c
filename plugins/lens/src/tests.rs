//! What both perturbations have to hold.

use std::time::{Duration, Instant};

use pdk_sdk::config::frame_values;
use pdk_sdk::ops::compare::{mean_squared_difference, structural_similarity};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value, from_str};
use pdk_sdk::testing::sample_frame;

use crate::raindrops_on_lens::RaindropsOnLens;
use crate::snow_on_lens::SnowOnLens;

/// One instance with its parameters, asked for frames at any time.
pub struct Film<P> {
    instance: P,
    description: Description,
    config: Config,
    names: Vec<String>,
    values: Vec<f64>,
    pub level: f64,
    pub key: Key,
}

impl<P: Component + Perturbation> Film<P> {
    /// With the parameters `given` as a JSON object.
    pub fn new(given: &str, level: f64) -> Self {
        let description = P::description();
        let given: Value = from_str(given).unwrap();
        let config = Config::check(&description, given.as_object().unwrap_or(&Map::new())).unwrap();
        let names = description.parameters.iter().map(|p| p.name.clone()).collect();
        let instance = P::new(&config).unwrap();
        let key = Key([3; 32]);
        Self { instance, description, config, names, values: Vec::new(), level, key }
    }

    pub fn render(
        &mut self,
        src: Frame<'_>,
        dst: FrameMut<'_>,
        time: f64,
        map: Option<&[f32]>,
    ) -> Result<()> {
        frame_values(&self.description, &self.config, self.level, &mut self.values);
        let mut cx = Context::new(self.level, 0, time, &self.key).with_values(&self.names, &self.values);
        let times = [0.0];
        if let Some(map) = map {
            cx = cx.with_saliency(map, EarlierMaps::new(&times, map, src.width(), src.height())?);
        }
        self.instance.apply(src, dst, &cx)
    }

    pub fn at(&mut self, src: &FrameBuf, time: f64) -> FrameBuf {
        let mut dst = FrameBuf::new(src.width(), src.height());
        self.render(src.as_ref(), dst.as_mut(), time, None).unwrap();
        dst
    }
}

/// The check `test` for both perturbations.
macro_rules! both {
    ($($test:ident),* $(,)?) => {
        mod rain {
            $(#[test] fn $test() { super::$test::<super::RaindropsOnLens>(); })*
        }
        mod snow {
            $(#[test] fn $test() { super::$test::<super::SnowOnLens>(); })*
        }
    };
}

both!(
    passes_the_test_kit,
    writes_exactly_the_frame,
    a_frame_alone_equals_one_in_sequence,
    moves_without_flicker,
    grows_with_the_intensity,
    an_intensity_that_rises_makes_nothing_jump,
    places_do_not_depend_on_the_intensity,
    keys_differ,
    resolutions_agree,
    starts_clear_if_it_is_set_to,
    attention_moves_it_to_salient_places,
    what_is_born_stays_when_the_map_changes,
    refuses_impossible_times,
    late_frames_alone_are_fast,
    keeps_its_memory,
    takes_frames_of_extreme_shape,
    stays_dark_in_the_dark,
);

fn passes_the_test_kit<P: Component + Perturbation + 'static>() {
    pdk_sdk::testing::perturbation::<P>();
}

fn writes_exactly_the_frame<P: Component + Perturbation>() {
    crate::golden::writes_exactly_the_frame::<P>(&Value::Null);
}

/// The mean squared difference.
fn difference(a: &FrameBuf, b: &FrameBuf) -> f64 {
    mean_squared_difference(a.as_ref(), b.as_ref())
}

/// A road: bright sky, dark ground, a line.
fn scene(width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
            let line = v > 0.5 && (u - 0.5).abs() < 0.1 * (v - 0.45);
            let pixel = match v < 0.5 {
                true => [120, 160, (220.0 - 60.0 * v) as u8],
                false if line => [230, 220, 120],
                false => [70 + (30.0 * u) as u8, 70, 75],
            };
            frame.as_mut().set_pixel(x, y, pixel);
        }
    }
    frame
}

fn a_frame_alone_equals_one_in_sequence<P: Component + Perturbation>() {
    let source = scene(120, 90);
    let mut random = Key([8; 32]).sequence();
    for level in [0.7, 4.0] {
        let mut sequence = Film::<P>::new("{}", level);
        let mut times: Vec<f64> = (0..90).map(|i| f64::from(i) / 30.0).collect();
        times.extend((0..40).map(|_| random.uniform(-5.0, 900.0)));
        times.extend([0.0, 1e6, 599.99, 600.0, 600.04]);
        for time in times {
            // Others come in between: other sizes, intensities and keys.
            if random.below(6) == 0 {
                sequence.level = random.uniform(0.0, 4.0);
                sequence.key = Key([random.below(3) as u8; 32]);
                let size = 1 + random.below(80) as usize;
                sequence.at(&sample_frame(size, 40), time + 1.0);
                (sequence.level, sequence.key) = (level, Key([3; 32]));
            }
            let alone = Film::<P>::new("{}", level).at(&source, time);
            assert_eq!(sequence.at(&source, time), alone, "at {time} s and level {level}");
        }
    }
}

fn moves_without_flicker<P: Component + Perturbation>() {
    let source = scene(320, 240);
    let mut film = Film::<P>::new("{}", 3.0);
    let (mut changes, mut strength, mut last) = (Vec::new(), 0.0, film.at(&source, 0.0));
    for i in 1..=150 {
        let frame = film.at(&source, f64::from(i) / 30.0);
        changes.push(difference(&frame, &last));
        strength += difference(&frame, &source) / 150.0;
        last = frame;
    }
    let mean = changes.iter().sum::<f64>() / changes.len() as f64;
    let highest = changes.iter().fold(0.0f64, |a, &b| a.max(b));
    let unrelated = difference(&last, &film.at(&source, 500.0));
    println!(
        "frame to frame {mean:.2}, at most {highest:.2}; from the scene {strength:.1}; unrelated frames {unrelated:.1}"
    );
    // It moves, and what moves from one frame to the next is a small part of what is there.
    assert!(mean > 0.1 && mean < 0.12 * unrelated, "{mean} of {unrelated}");
    assert!(highest < 0.3 * unrelated, "{highest} of {unrelated}");
}

fn grows_with_the_intensity<P: Component + Perturbation>() {
    let source = scene(160, 120);
    let mut film = Film::<P>::new("{}", 0.0);
    let mut last = (0.0, 0.0);
    for step in 0..=16 {
        film.level = f64::from(step) / 4.0;
        let (mut strength, mut dissimilarity) = (0.0, 0.0);
        for second in 0..12 {
            let frame = film.at(&source, f64::from(second) * 7.3);
            strength += difference(&frame, &source) / 12.0;
            dissimilarity += (1.0 - structural_similarity(frame.as_ref(), source.as_ref())) / 12.0;
        }
        println!("level {}: mse {strength:.1}, 1 - ssim {dissimilarity:.4}", film.level);
        assert!(strength > last.0 && dissimilarity > last.1, "at level {}", film.level);
        last = (strength, dissimilarity);
    }
}

fn an_intensity_that_rises_makes_nothing_jump<P: Component + Perturbation>() {
    let source = scene(80, 60);
    let mut film = Film::<P>::new("{}", 0.0);
    let mut last = film.at(&source, 20.0);
    let mut highest = 0.0f64;
    for i in 1..=4000 {
        film.level = f64::from(i) / 1000.0;
        let frame = film.at(&source, 20.0);
        highest = highest.max(difference(&frame, &last));
        last = frame;
    }
    let whole = difference(&last, &source);
    println!("at most {highest:.2} of {whole:.1}");
    assert!(highest < 0.03 * whole, "{highest} of {whole}");
}

/// The same number and size at all intensities leave nothing that the intensity changes: not where anything is. So nothing
/// runs uphill, and nothing jumps, when the intensity follows a schedule.
fn places_do_not_depend_on_the_intensity<P: Component + Perturbation>() {
    let source = scene(160, 120);
    let mut film = Film::<P>::new(r#"{"number": 120, "size": 0.055}"#, 4.0);
    for time in [3.0, 20.0, 41.7] {
        film.level = 4.0;
        let high = film.at(&source, time);
        assert_ne!(high, source);
        for level in [0.0, 1.3, 2.0] {
            film.level = level;
            assert_eq!(film.at(&source, time), high, "at {time} s and level {level}");
        }
    }
}

fn keys_differ<P: Component + Perturbation>() {
    let source = scene(160, 120);
    let mut film = Film::<P>::new("{}", 2.0);
    let first = film.at(&source, 1.0);
    film.key = Key([4; 32]);
    let second = film.at(&source, 1.0);
    let strength = difference(&first, &source);
    assert!(difference(&first, &second) > strength, "two keys put drops in the same places");
}

fn resolutions_agree<P: Component + Perturbation>() {
    let mut film = Film::<P>::new("{}", 3.0);
    let strengths = [(320, 240), (640, 480), (1280, 960)].map(|(width, height)| {
        let source = scene(width, height);
        (0..4).map(|i| difference(&film.at(&source, f64::from(i) * 9.0), &source)).sum::<f64>()
    });
    println!("{strengths:?}");
    let large = strengths[2];
    assert!(strengths.iter().all(|s| (s / large - 1.0).abs() < 0.15), "{strengths:?}");
    // The same drops in the same places: a large frame made small is close to a small one.
    let small = film.at(&scene(320, 240), 2.0);
    let large = film.at(&scene(640, 480), 2.0);
    let mut halved = FrameBuf::new(320, 240);
    for y in 0..240 {
        for x in 0..320 {
            let at = |i: usize| large.as_ref().pixel(2 * x + i % 2, 2 * y + i / 2);
            let sums =
                (0..4).map(at).fold([0u32; 3], |sum, p| std::array::from_fn(|c| sum[c] + u32::from(p[c])));
            halved.as_mut().set_pixel(x, y, sums.map(|sum| (sum / 4) as u8));
        }
    }
    let apart = difference(&small, &halved);
    let strength = difference(&small, &scene(320, 240));
    println!("{apart:.1} of {strength:.1}");
    assert!(apart < 0.25 * strength, "{apart} of {strength}");
}

fn starts_clear_if_it_is_set_to<P: Component + Perturbation>() {
    let source = scene(160, 120);
    let mut film = Film::<P>::new(r#"{"since": 0}"#, 4.0);
    assert_eq!(film.at(&source, 0.0), source);
    let strengths = [0.5, 3.0, 8.0].map(|time| difference(&film.at(&source, time), &source));
    assert!(
        0.0 < strengths[0] && strengths[0] < strengths[1] && strengths[1] < strengths[2],
        "{strengths:?}"
    );
    // Later the start is forgotten.
    assert_eq!(film.at(&source, 40.0), Film::<P>::new("{}", 4.0).at(&source, 40.0));
}

fn attention_moves_it_to_salient_places<P: Component + Perturbation>() {
    let source = scene(320, 240);
    let right: Vec<f32> = (0..320 * 240).map(|i| if i % 320 >= 160 { 1.0 } else { 0.02 }).collect();
    let even = vec![0.3; 320 * 240];
    let mut film = Film::<P>::new("{}", 2.0);
    let mut render = |map: &[f32], time: f64| {
        let mut dst = FrameBuf::new(320, 240);
        film.render(source.as_ref(), dst.as_mut(), time, Some(map)).unwrap();
        dst
    };
    let mut halves = [0.0; 2];
    for i in 0..10 {
        let frame = render(&right, f64::from(i) * 11.0);
        for (at, (a, b)) in frame.data().iter().zip(source.data()).enumerate() {
            halves[at / 3 % 320 / 160] += f64::from(a.abs_diff(*b)).powi(2);
        }
    }
    assert!(halves[1] > 4.0 * halves[0], "{halves:?}");
    // A map that says nothing changes nothing.
    assert_eq!(render(&even, 1.0), Film::<P>::new("{}", 2.0).at(&source, 1.0));
    // Neither does one of zeros stop the run.
    render(&vec![0.0; 320 * 240], 1.0);
}

/// What was born where a map was high stays when the map is another one, and goes on as it would have.
fn what_is_born_stays_when_the_map_changes<P: Component + Perturbation>() {
    let source = scene(320, 240);
    let half = |right: bool| move |i: usize| if (i % 320 >= 160) == right { 1.0 } else { 0.02 };
    let (left, right) = ((0..320 * 240).map(half(false)), (0..320 * 240).map(half(true)));
    let both: Vec<f32> = left.chain(right).collect();
    let key = Key([3; 32]);
    let film = Film::<P>::new("{}", 2.0);
    let mut values = Vec::new();
    frame_values(&film.description, &film.config, 2.0, &mut values);
    let mut instance = P::new(&film.config).unwrap();
    let mut changed = |times: &[f64], maps: &[f32], time: f64| {
        let mut dst = FrameBuf::new(320, 240);
        let cx = Context::new(2.0, 0, time, &key).with_values(&film.names, &values);
        let cx = cx.with_saliency(&both[..320 * 240], EarlierMaps::new(times, maps, 320, 240).unwrap());
        instance.apply(source.as_ref(), dst.as_mut(), &cx).unwrap();
        let mut halves = [0.0; 2];
        for (at, (a, b)) in dst.data().iter().zip(source.data()).enumerate() {
            halves[at / 3 % 320 / 160] += f64::from(a.abs_diff(*b)).powi(2);
        }
        halves
    };
    // The map marks the left half, and the right one since second 30.
    let before = changed(&[0.0], &both[..320 * 240], 30.05);
    let just_after = changed(&[0.0, 30.0], &both, 30.05);
    let long_after = changed(&[0.0, 30.0], &both, 90.0);
    assert!(before[0] > 3.0 * before[1], "{before:?}");
    assert!((just_after[0] / before[0] - 1.0).abs() < 0.2, "{before:?} {just_after:?}");
    assert!(long_after[1] > 3.0 * long_after[0], "{long_after:?}");
}

fn refuses_impossible_times<P: Component + Perturbation>() {
    let source = scene(16, 12);
    let mut dst = FrameBuf::new(16, 12);
    let mut film = Film::<P>::new("{}", 2.0);
    for time in [f64::NAN, f64::INFINITY, -1e12] {
        let refused = film.render(source.as_ref(), dst.as_mut(), time, None).unwrap_err();
        assert!(refused.message().contains("time"), "{refused}");
    }
}

fn late_frames_alone_are_fast<P: Component + Perturbation>() {
    let source = scene(320, 240);
    let started = processor_time();
    Film::<P>::new("{}", 4.0).at(&source, 600.0);
    let alone = processor_time() - started;
    println!("a frame at 600 s alone takes {alone:?}");
    assert!(alone.as_millis() < 500, "{alone:?}");
}

/// The processor time of this thread, which does not depend on what else the machine does.
fn processor_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

fn keeps_its_memory<P: Component + Perturbation>() {
    let source = scene(320, 240);
    let mut dst = FrameBuf::new(320, 240);
    let mut film = Film::<P>::new("{}", 4.0);
    // A frame a second apart, so that births go on; the first ones find out how much memory is needed.
    for i in 0..60 {
        film.render(source.as_ref(), dst.as_mut(), f64::from(i), None).unwrap();
    }
    let before = crate::allocations::count();
    for i in 60..90 {
        film.render(source.as_ref(), dst.as_mut(), f64::from(i), None).unwrap();
    }
    assert_eq!(crate::allocations::count() - before, 0);
}

fn stays_dark_in_the_dark<P: Component + Perturbation>() {
    let night = FrameBuf::new(160, 120);
    let found = Film::<P>::new("{}", 4.0).at(&night, 5.0);
    assert!(found == night, "nothing shines of itself");
}

fn takes_frames_of_extreme_shape<P: Component + Perturbation>() {
    let mut film = Film::<P>::new("{}", 4.0);
    for (width, height) in [(1, 1), (5000, 1), (1, 5000), (4000, 3), (3, 4000), (7, 5)] {
        let started = Instant::now();
        film.at(&sample_frame(width, height), 3.0);
        assert!(started.elapsed().as_secs() < 20, "{width}x{height}");
    }
}

/// Times on one thread: `cargo test --release -p pdk-lens -- --ignored --nocapture times`
#[test]
#[ignore = "prints times"]
fn times() {
    fn time<P: Component + Perturbation>() {
        for (width, height) in [(320, 240), (1280, 720)] {
            let source = scene(width, height);
            let mut dst = FrameBuf::new(width, height);
            for level in [0.0, 2.0, 4.0] {
                let mut film = Film::<P>::new("{}", level);
                let mut each = Vec::new();
                for i in 0..120 {
                    let started = Instant::now();
                    film.render(source.as_ref(), dst.as_mut(), f64::from(i) / 30.0, None).unwrap();
                    each.push(started.elapsed().as_secs_f64() * 1e3);
                }
                each.remove(0);
                each.sort_by(f64::total_cmp);
                let name = P::description().name;
                println!(
                    "{name} {width}x{height} level {level}: fastest {:.2} ms, median {:.2} ms, slowest {:.2} ms",
                    each[0], each[59], each[118]
                );
            }
        }
    }
    time::<RaindropsOnLens>();
    time::<SnowOnLens>();
}
