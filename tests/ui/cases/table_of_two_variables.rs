use casados::dae;

#[dae]
mod model {
    use casados::tables::Linear2;

    const MAP: Linear2<2, 2> = Linear2::new([0.0, 1.0], [0.0, 1.0], [[0.0; 2]; 2]);

    pub fn model(xdot: f64, x: f64) -> f64 {
        xdot - MAP.value(x)
    }
}

fn main() {}
