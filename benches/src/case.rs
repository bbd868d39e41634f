//! What is computed: a model, an interval, a method.

use crate::models::stretched;
use crate::record::{load, numbers};
use serde_json::{Value, json};

/// What is asked of an integrator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The state at the end.
    Simulation,
    /// And its derivatives.
    Forward,
    /// The state at the end, and the gradient of `λᵀx`.
    Adjoint,
    /// All of these, and the Hessian of `λᵀx`.
    Hessian,
}

impl Mode {
    /// In the order of all tables.
    pub const ALL_MODES: [Self; 4] = [Self::Simulation, Self::Forward, Self::Adjoint, Self::Hessian];

    /// As in tables and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Simulation => "simulation",
            Self::Forward => "forward",
            Self::Adjoint => "adjoint",
            Self::Hessian => "hessian",
        }
    }
}

/// A family of methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Gauss-Legendre collocation.
    Gauss,
    /// Radau IIA collocation.
    Radau,
    /// The explicit method of order 4.
    Rk4,
}

/// Results as flat lists: Jacobians by rows, of Hessians the lower triangle by rows. Empty: not
/// known.
#[derive(Clone, Debug, Default)]
pub struct Values {
    /// The state at the end.
    pub x: Vec<f64>,
    /// `d x/d(x₀, u)`
    pub forward: Vec<f64>,
    /// `∇(λᵀx)`
    pub adjoint: Vec<f64>,
    /// `∇²(λᵀx)`
    pub hessian: Vec<f64>,
}

impl Values {
    /// From a JSON object.
    #[must_use]
    pub fn read(value: &Value) -> Self {
        let x = if value["x_next"].is_null() { &value["x"] } else { &value["x_next"] };
        Self {
            x: numbers(x),
            forward: numbers(&value["forward"]),
            adjoint: numbers(&value["adjoint"]),
            hessian: numbers(&value["hessian"]),
        }
    }

    /// The part that a mode is asked for.
    #[must_use]
    pub fn part_of_mode(&self, mode: Mode) -> &[f64] {
        match mode {
            Mode::Simulation => &self.x,
            Mode::Forward => &self.forward,
            Mode::Adjoint => &self.adjoint,
            Mode::Hessian => &self.hessian,
        }
    }

    /// The largest error of that part, relative to the largest element of the reference; none where
    /// one of the two is not known.
    #[must_use]
    pub fn relative_error(&self, reference: &Self, mode: Mode) -> Option<f64> {
        let (a, b) = (self.part_of_mode(mode), reference.part_of_mode(mode));
        if b.is_empty() || a.len() != b.len() {
            return None;
        }
        let largest = |max: f64, e: f64| if e.is_nan() || e > max { e } else { max };
        let scale = b.iter().map(|b| b.abs()).fold(0.0, largest);
        Some(a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, largest) / scale)
    }
}

/// Initial state and control.
pub type Input = (Vec<f64>, Vec<f64>);

/// A model, an interval, a method.
#[derive(Clone, Debug)]
pub struct Case {
    /// As in all tables.
    pub name: String,
    /// `pendulum`, `chain` or `awe`.
    pub model: &'static str,
    /// Differential states.
    pub nx: usize,
    /// Length of the interval, s.
    pub t: f64,
    /// The method.
    pub family: Family,
    /// Its stages.
    pub stages: usize,
    /// Steps in the interval.
    pub steps: usize,
    /// Forty intervals, as of a horizon.
    pub inputs: Vec<Input>,
    /// So many of them, from the first on, are what a single call is timed with.
    pub single: usize,
    /// The seed of adjoint and Hessian.
    pub lambda: Vec<f64>,
    /// Where reference values are, and those of the first input.
    pub reference: Option<(&'static str, Values)>,
}

impl Case {
    /// The pendulum on a cart, 0.05 s.
    #[must_use]
    pub fn pendulum(family: Family, stages: usize, steps: usize) -> Self {
        let x0 = vec![0.0, 3.441592653589793, 0.5, -0.7];
        Self::new("pendulum", 4, 0.05, family, stages, steps, (x0, vec![1.5]))
    }

    /// The chain of masses, 0.2 s.
    ///
    /// # Panics
    /// For a size that [`start`] has not.
    #[must_use]
    pub fn chain(masses: usize, family: Family, stages: usize, steps: usize) -> Self {
        let x0 = start(masses);
        let mut case = Self::new("chain", x0.len(), 0.2, family, stages, steps, (x0, vec![-1.0, 1.0, 1.0]));
        case.name = case.name.replacen("chain", &format!("chain {masses}"), 1);
        case
    }

    fn new(
        model: &'static str,
        nx: usize,
        t: f64,
        family: Family,
        stages: usize,
        steps: usize,
        first: Input,
    ) -> Self {
        // Neighbours of the first interval: each element moved by up to a hundredth.
        let moved = |k: usize, v: &[f64]| -> Vec<f64> {
            v.iter().enumerate().map(|(i, v)| v + 0.01 * ((k * (i + 3)) as f64).sin()).collect()
        };
        let inputs = (0..40).map(|k| (moved(k, &first.0), moved(k, &first.1))).collect();
        let method = if family == Family::Rk4 { "erk4".into() } else { format!("s{stages}") };
        Self {
            name: format!("{model} {method}n{steps}"),
            model,
            nx,
            t,
            family,
            stages,
            steps,
            inputs,
            single: 1,
            lambda: (0..nx).map(|i| 1.0 + 0.1 * (i as f64).cos()).collect(),
            reference: None,
        }
    }

    /// The aircraft on a tether: the intervals of its optimal orbit, one step of Radau IIA with 4
    /// stages each.
    ///
    /// # Errors
    /// If the reference data cannot be read.
    pub fn awe() -> Result<Self, String> {
        let data = load("tests/data/awe/intervals.json")?;
        let intervals = data["intervals"].as_array().ok_or("`intervals` is not a list")?;
        let inputs = intervals.iter().map(|i| (numbers(&i["x0"]), numbers(&i["u"]))).collect();
        let reference = intervals.first().map(|i| ("data", Values::read(i)));
        let t = data["T"].as_f64().ok_or("`T` is not a number")?;
        let (family, lambda) = (Family::Radau, numbers(&data["lambda"]));
        let name = "awe radau s4n1".into();
        Ok(Self {
            name,
            model: "awe",
            nx: 23,
            t,
            family,
            stages: 4,
            steps: 1,
            inputs,
            single: 40,
            lambda,
            reference,
        })
    }

    /// Takes the reference from a file of `tests/data`, if its interval is this one.
    ///
    /// # Errors
    /// If the file cannot be read, or is of another interval.
    pub fn with_reference(mut self, file: &str) -> Result<Self, String> {
        let data = load(&format!("tests/data/{file}"))?;
        let same = |a: &[f64], b: &Value| a.iter().zip(numbers(b)).all(|(a, b)| (a - b).abs() < 1e-12);
        let (x0, u) = &self.inputs[0];
        let fits = same(x0, &data["x0"]) && same(u, &data["u"]) && same(&[self.t], &json!([data["T"]]));
        if !fits || !same(&self.lambda, &data["lambda"]) {
            return Err(format!("{file} has another interval than {}", self.name));
        }
        self.reference = Some(("acados", Values::read(&data)));
        Ok(self)
    }

    /// What the peers are told, with so many of the inputs.
    #[must_use]
    pub fn to_json(&self, inputs: usize) -> Value {
        let scheme = if self.family == Family::Radau { "radau" } else { "legendre" };
        json!({
            "name": self.name, "model": self.model, "nx": self.nx, "T": self.t, "scheme": scheme,
            "stages": if self.family == Family::Rk4 { 0 } else { self.stages }, "steps": self.steps,
            "inputs": self.inputs[..inputs], "lambda": self.lambda, "tolerance": 1e-8,
        })
    }
}

/// The first interval of a chain starts here.
fn start(masses: usize) -> Vec<f64> {
    macro_rules! sizes {
        ($($masses:literal $nx:literal),*) => {
            match masses {
                $($masses => stretched::<$nx>().as_slice().to_vec(),)*
                _ => panic!("there is no chain of {masses} masses"),
            }
        };
    }
    sizes!(3 9, 5 21, 7 33, 9 45, 13 69, 17 93, 33 189, 65 381)
}
