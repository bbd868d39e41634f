use casados::ode;

#[ode]
fn model(x: [f64; 2]) -> [f64; 2] {
    let mut terms = Vec::new();
    terms.push(x[0] * x[1]);
    [terms[0], x[0]]
}

fn main() {}
