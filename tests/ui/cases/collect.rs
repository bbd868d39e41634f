use casados::ode;

#[ode]
fn model(x: [f64; 2]) -> [f64; 2] {
    let squares: Vec<f64> = x.iter().map(|a| a * a).collect();
    [squares[0], squares[1]]
}

fn main() {}
