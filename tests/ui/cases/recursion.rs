use casados::ode;

#[ode]
fn model(x: [f64; 1]) -> [f64; 1] {
    fn deeper(a: f64) -> f64 {
        if a > 0.0 { deeper(a - 1.0) } else { a }
    }
    [deeper(x[0])]
}

fn main() {}
