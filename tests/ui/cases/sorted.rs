use casados::ode;

#[ode]
fn model(x: [f64; 3]) -> [f64; 3] {
    let mut sorted = x;
    sorted.sort_by(|a, b| a.total_cmp(b));
    sorted
}

fn main() {}
