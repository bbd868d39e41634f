use casados::ode;
use nalgebra::{Matrix2, Vector3};

#[ode]
fn model(x: Vector3<f64>) -> Vector3<f64> {
    let a = Matrix2::new(1.0, 2.0, 3.0, 4.0);
    let b = a.determinant() * x;
    let c = a.try_inverse().unwrap();
    b * c.m11
}

fn main() {}
