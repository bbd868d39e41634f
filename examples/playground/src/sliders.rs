//! The pendulum over the whole range of the sliders.

use crate::controller::{DEFAULT, Loop, Settings};
use std::error::Error;

type Test = Result<(), Box<dyn Error>>;

/// Frames of a second.
const FRAMES: usize = 60;
/// Seconds until it stands, from below and after a push, at most.
const UP: usize = 20;
/// A push as that of a key: N on the ball to the right, and seconds. The ball weighs 1 N, so it
/// goes around once, or nearly.
const PUSH: [f64; 3] = [0.0, 2.0, 0.0];
const PUSHED: f64 = 0.2;

/// Index, from, to of every slider of the page.
fn sliders() -> Vec<(usize, f64, f64)> {
    let page = include_str!("../page/pendulum.js");
    let (_, rest) = page.split_once("const SLIDERS = [").expect("the page has sliders");
    let (list, _) = rest.split_once("\n];").expect("their list ends");
    let number = |text: Option<&str>| text.and_then(|text| text.trim().parse::<f64>().ok());
    list.split("],")
        .filter_map(|entry| {
            let mut parts = entry.trim_end_matches(']').rsplit(',');
            let (to, from, index) = (number(parts.next()), number(parts.next()), number(parts.next()));
            Some((index? as usize, from?, to?))
        })
        .collect()
}

/// Until it has stood for a second in the middle, in seconds; the largest distance from the middle.
fn stands(the: &mut Loop, most: usize) -> Result<(Option<f64>, f64), Box<dyn Error>> {
    let (mut since, mut far) = (0, 0.0_f64);
    for frame in 0..most * FRAMES {
        the.advance(1.0 / FRAMES as f64, [0.0; 3])?;
        far = far.max(the.x[0].abs());
        let is_there = (the.x[1] - the.upright()).abs() < 0.1 && the.x[0].abs() < 0.2;
        since = if is_there { since + 1 } else { 0 };
        if since > FRAMES {
            return Ok((Some(frame as f64 / FRAMES as f64), far));
        }
    }
    Ok((None, far))
}

/// What went wrong with these settings; seconds of the longer swing-up, and how far the cart was
/// beyond its track after the push, m.
fn tried(settings: &Settings) -> Result<(Vec<String>, f64, f64), Box<dyn Error>> {
    let mut wrong = Vec::new();
    let track = settings[6];
    let mut the = Loop::new()?;
    the.apply(settings)?;
    let (up, far) = stands(&mut the, UP)?;
    if up.is_none() {
        wrong.push(format!("it never stands: {:?}", the.x));
    }
    // The bounds are soft.
    if far > track + 0.3 {
        wrong.push(format!("on its way up the cart was at {far}"));
    }
    the.advance(PUSHED, PUSH)?;
    let (again, far) = stands(&mut the, UP)?;
    if again.is_none() {
        wrong.push(format!("after a push it never stands: {:?}", the.x));
    }
    if far > track + 1.3 {
        wrong.push(format!("after a push the cart was at {far}"));
    }
    let [up, again] = [up, again].map(|seconds| seconds.unwrap_or(f64::INFINITY));
    Ok((wrong, up.max(again), far - track))
}

/// Prints what came of many settings, and fails where any of them went wrong.
fn all(settings: impl Iterator<Item = Settings>) -> Test {
    let (mut slowest, mut farthest, mut mistakes) = (0.0_f64, f64::NEG_INFINITY, Vec::new());
    for settings in settings {
        let (wrong, up, beyond) = tried(&settings)?;
        (slowest, farthest) = (slowest.max(up), farthest.max(beyond));
        if !wrong.is_empty() {
            mistakes.push(format!("{settings:?}: {}", wrong.join("; ")));
        }
    }
    println!(
        "it stands after {slowest:.1} s at most; a push moves it {farthest:.2} m beyond the track at most"
    );
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes.join("\n").into()) }
}

#[test]
fn one_slider_at_a_time() -> Test {
    let sliders = sliders();
    assert_eq!(sliders.len(), DEFAULT.len());
    all(sliders.into_iter().flat_map(|(i, from, to)| {
        (0..=4).map(move |k| {
            let mut settings = DEFAULT;
            settings[i] = from * (to / from).powf(0.25 * f64::from(k));
            settings
        })
    }))
}

#[test]
fn all_sliders_at_once() -> Test {
    let sliders = sliders();
    let mut seed = 7_u64;
    // Between 0 and 1 (SplitMix: Steele, Lea and Flood, 2014).
    let mut equally = move || {
        seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let count: u32 = std::env::var("SETTINGS").map_or(Ok(100), |text| text.parse())?;
    all((0..count).map(|_| {
        let mut settings = DEFAULT;
        for &(i, from, to) in &sliders {
            settings[i] = from * (to / from).powf(equally());
        }
        settings
    }))
}

/// Every slider at one of its ends.
#[test]
fn corners() -> Test {
    let sliders = sliders();
    all((0..1 << sliders.len()).map(|corner: usize| {
        let mut settings = DEFAULT;
        for (bit, &(i, from, to)) in sliders.iter().enumerate() {
            settings[i] = if corner >> bit & 1 == 1 { to } else { from };
        }
        settings
    }))
}

/// A push beyond all numbers is an error; a new pendulum stands up. Newton's method finds a state
/// after any other push.
#[test]
fn a_push_without_measure_is_an_error() -> Test {
    let mut the = Loop::new()?;
    the.apply(&DEFAULT)?;
    assert!(the.advance(0.1, [0.0, 1e20, 0.0]).is_ok());
    assert!(the.advance(0.1, [0.0, 1e200, 0.0]).is_err());
    let mut the = Loop::new()?;
    the.apply(&DEFAULT)?;
    assert!(stands(&mut the, UP)?.0.is_some());
    Ok(())
}
