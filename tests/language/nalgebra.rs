//! Small nalgebra values.

use crate::{same_bits, subarray};
use casados::dae;
use nalgebra::{
    Matrix2, Matrix3, Matrix3x2, SMatrix, SVector, Vector2, Vector3, Vector4, Vector6, matrix, vector,
};

#[dae]
fn vectors(xdot: Vector6<f64>, x: Vector6<f64>, u: Vector3<f64>) -> Vector6<f64> {
    let a = Vector3::new(x[0], x[1], x[2]);
    let b: Vector3<f64> = x.fixed_rows::<3>(3).into();
    let c = a.cross(&b) + 2.0 * u - u / 3.0;
    let mut d = vector![a.dot(&b), a.norm(), b.norm_squared()];
    d += a.component_mul(&b);
    d -= a.component_div(&vector![3.0 + b.x * b.x, 2.0, 4.0]);
    d *= 0.5;
    d.y = -d.y;
    d[2] += u.z;
    let unit = a.normalize();
    let e = -c.map(|c| c * c) + unit * u.sum();
    let four = Vector4::from([x[0], x[1], x[2], x[3]]);
    let five = SVector::<f64, 5>::from_fn(|i, _| x[i] * i as f64);
    let nine = SVector::<f64, 9>::from_column_slice(&[x[0], x[1], x[2], x[3], x[4], x[5], u[0], u[1], u[2]]);
    let lengths =
        four.dot(&four) + five.norm() + nine.norm_squared() + x.norm() + nine.metric_distance(&(nine * 0.7));
    let mut f = xdot - x * lengths;
    for i in 0..3 {
        f[i] -= d[i];
        let (half, up): (Vector3<f64>, Vector3<f64>) = (Vector3::repeat(1.5), Vector3::y());
        f[i + 3] += e[i] - half[i] + up[i];
    }
    f += SVector::<f64, 6>::zeros();
    f
}

#[dae]
fn matrices(xdot: Matrix3<f64>, x: Matrix3<f64>, u: Matrix2<f64>) -> Matrix3<f64> {
    let skew = Vector3::new(u.m11, u.m12, u.m21).cross_matrix();
    let drift = Matrix3::identity() - x.transpose() * x;
    let m = matrix![u.m11, u[(0, 1)]; 2.0, u.m22];
    let wide = Matrix3x2::from_columns(&[x.column(0).into_owned(), x.column(2).into_owned()]);
    let tall: SMatrix<f64, 3, 2> = wide * m;
    let rows = Matrix3::from_rows(&[x.row(2), x.row(0), x.row(1)].map(|row| row.into_owned()));
    let diagonal = Matrix3::from_diagonal(&x.diagonal()) * u.determinant() + rows * x.trace();
    let mut f = xdot - x * (drift * 0.5 + skew) + diagonal * x.determinant();
    f.fixed_view_mut::<3, 2>(0, 1).copy_from(&tall);
    f += xdot + tall * wide.transpose();
    f.set_column(0, &(f.column(0) + x * Vector3::new(1.0, 2.0, 3.0)));
    f[(1, 1)] -= x.norm();
    let mixed = Matrix2::from_row_slice(&[1.0, 2.0, 3.0, 4.0]) * Vector2::new(x.m11, x.m33);
    f.m33 += mixed.x * mixed.y + x.iter().sum::<f64>() + x.fixed_view::<2, 2>(1, 0).sum();
    f
}

#[test]
fn vector_operations() {
    same_bits::<Vectors>(|v| {
        let [xdot, x] = [Vector6::from(subarray::<6>(v, 0)), Vector6::from(subarray::<6>(v, 6))];
        vectors(xdot, x, Vector3::from(subarray::<3>(v, 12))).as_slice().to_vec()
    });
}

#[test]
fn matrix_operations() {
    same_bits::<Matrices>(|v| {
        let xdot = Matrix3::from_column_slice(&v[..9]);
        let x = Matrix3::from_column_slice(&v[9..18]);
        matrices(xdot, x, Matrix2::from_column_slice(&v[18..22])).as_slice().to_vec()
    });
}
