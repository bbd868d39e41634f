//! Iterators and methods of arrays.

use crate::{same_bits, subarray};
use casados::dae;

#[dae]
fn adaptors(xdot: [f64; 8], x: [f64; 8], u: [f64; 4]) -> [f64; 8] {
    let dot: f64 = x.iter().zip(&u).map(|(a, b)| a * b).sum();
    let product: f64 = u.iter().copied().product();
    let horner = u.iter().rev().fold(0.0, |sum, c| sum * x[0] + c);
    let differences: f64 = x.windows(2).map(|w| (w[1] - w[0]) * (w[1] - w[0])).sum();
    let blocks = x.chunks_exact(2).map(|pair| pair[0] * pair[1]).fold(1.0, |a, b| a - b);
    let chained: f64 = x.iter().take(2).chain(x.iter().skip(6)).cloned().sum();
    let stepped = x.iter().step_by(3).enumerate().map(|(i, a)| i as f64 * a).sum::<f64>();
    let flat: f64 = (0..3).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| x[i] * x[j]).sum();
    let cycled: f64 = u.into_iter().cycle().skip(1).take(6).zip(x).map(|(a, b)| a / (3.0 + b)).sum();
    let largest = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let odd: f64 = x.iter().enumerate().filter(|(i, _)| i % 2 == 1).map(|(_, a)| a).sum();
    let back: f64 = x.iter().enumerate().rev().take(2).map(|(i, a)| a * i as f64).sum();
    let scanned: f64 = u
        .iter()
        .scan(0.0, |sum, a| {
            *sum += a;
            Some(*sum * a)
        })
        .sum();
    let all = core::iter::repeat(x[3]).take(2).chain(core::iter::once(x[4])).map(f64::sin).sum::<f64>();
    let mut iter = x.iter();
    let (Some(first), Some(last)) = (iter.next(), iter.next_back()) else { unreachable!() };
    let middle: f64 = iter.sum();
    let position = [3, 1, 4, 1, 5].iter().position(|&d| d == 4).unwrap();
    let mut f = xdot;
    f[0] -= dot + product;
    f[1] -= horner - differences;
    f[2] -= blocks * chained;
    f[3] -= stepped + flat + back;
    f[4] -= cycled * largest;
    f[5] -= odd - scanned;
    f[6] -= all * first - last;
    f[position + 5] -= middle;
    f
}

#[dae]
fn arrays(xdot: [f64; 6], x: [f64; 6], u: [[f64; 3]; 2]) -> [f64; 6] {
    let squares = x.map(|a| a * a);
    let table: [[f64; 3]; 2] =
        core::array::from_fn(|i| core::array::from_fn(|j| u[i][j] * (i + 2 * j) as f64));
    let long = std::array::from_fn::<f64, 6, _>(|i| squares[5 - i]);
    let mut a = x;
    a.swap(0, 5);
    a[1..4].reverse();
    a[4..].copy_from_slice(&long[..2]);
    let (left, right) = x.split_at(2);
    let mut b = [0.0; 6];
    b[..3].fill(left[0]);
    b[3..].clone_from_slice(&right[1..]);
    let joined = u.concat();
    for (b, a) in b.iter_mut().zip(joined) {
        *b += a;
    }
    let head: [f64; 2] = x[..2].try_into().unwrap();
    let ends = x.first().unwrap() * x.last().unwrap() + x.len() as f64;
    for pair in a.chunks_exact_mut(2) {
        pair[0] += pair[1];
    }
    core::array::from_fn(|i| xdot[i] - a[i] * b[i] + table[i % 2][i / 2] - head[i % 2] * ends)
}

#[dae]
fn integers(xdot: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    let n = 2_usize.pow(3).min(7).max(1) + usize::BITS as usize / 64;
    let m = (-7_i32).rem_euclid(4).abs() as f64 + (n as i32 - 10).signum() as f64;
    let k = if n.is_multiple_of(4) { 1.5 } else { 2.5 };
    let largest = [3_usize, 8, 5].into_iter().max().unwrap() as f64;
    [xdot[0] - m * x[0] + largest, xdot[1] - k * x[1] * n.saturating_sub(20) as f64 - x[1] * (n << 1) as f64]
}

#[test]
fn iterators() {
    same_bits::<Adaptors>(|v| adaptors(subarray(v, 0), subarray(v, 8), subarray(v, 16)).to_vec());
}

#[test]
fn methods_of_arrays() {
    same_bits::<Arrays>(|v| {
        arrays(subarray(v, 0), subarray(v, 6), [subarray(v, 12), subarray(v, 15)]).to_vec()
    });
}

#[test]
fn methods_of_integers() {
    same_bits::<Integers>(|v| integers(subarray(v, 0), subarray(v, 2)).to_vec());
}
