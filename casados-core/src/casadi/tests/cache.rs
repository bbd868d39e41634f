//! Storage and replacement of results.

use crate::casadi::cache::{Cache, ComputedDerivatives, IntervalResults, key};
use alloc::vec;

fn results_with_value(value: f64) -> IntervalResults<()> {
    let mut answer = IntervalResults::default();
    answer.value.set(1)[0] = value;
    answer
}

fn store(cache: &mut Cache<()>, input: f64, answer: &mut IntervalResults<()>) {
    store_as(cache, key(&[input]), input, answer);
}

/// Stores results, with the derivatives that were computed.
fn store_as(cache: &mut Cache<()>, key: u64, input: f64, answer: &mut IntervalResults<()>) {
    let second = answer.lambda.get().map(|lambda| self::key(lambda));
    let given = ComputedDerivatives { jacobian: answer.jacobian.get().is_some(), second };
    cache.store(key, &[input], answer, given);
}

fn find(cache: &Cache<()>, input: f64) -> Option<&IntervalResults<()>> {
    cache.find(key(&[input]), &[input])
}

#[test]
fn the_oldest_inputs_are_forgotten() {
    let mut cache = Cache::new(2, true);
    for input in [1.0, 2.0, 3.0] {
        store(&mut cache, input, &mut results_with_value(10.0 * input));
    }
    assert!(find(&cache, 1.0).is_none());
    for input in [2.0, 3.0] {
        assert_eq!(find(&cache, input).unwrap().value.get().unwrap(), &[10.0 * input]);
    }
    store(&mut cache, 4.0, &mut results_with_value(40.0));
    assert!(find(&cache, 2.0).is_none() && find(&cache, 3.0).is_some());
    // Bits are compared: positive and negative zero differ.
    store(&mut cache, 0.0, &mut results_with_value(0.0));
    assert!(find(&cache, -0.0).is_none() && find(&cache, 0.0).is_some());
    let mut none = Cache::new(0, true);
    store(&mut none, 1.0, &mut results_with_value(1.0));
    assert!(find(&none, 1.0).is_none());
}

/// Inputs with equal keys replace each other, and are never confused.
#[test]
fn equal_keys_are_no_equal_inputs() {
    let mut cache = Cache::new(2, true);
    store_as(&mut cache, 7, 1.0, &mut results_with_value(10.0));
    store_as(&mut cache, 7, 2.0, &mut results_with_value(20.0));
    assert!(cache.find(7, &[1.0]).is_none());
    assert_eq!(cache.find(7, &[2.0]).unwrap().value.get().unwrap(), &[20.0]);
    store_as(&mut cache, 8, 3.0, &mut results_with_value(30.0));
    store_as(&mut cache, 9, 4.0, &mut results_with_value(40.0));
    assert!(cache.find(7, &[2.0]).is_none() && cache.find(8, &[3.0]).is_some());
}

#[test]
fn keys_of_like_inputs_differ() {
    let mut keys = std::collections::HashSet::new();
    // Inputs with few bits, at every place, with trailing zeros, and in all orders.
    for length in 1..=9 {
        for place in 0..length {
            for value in [1.0, -1.0, 2.0, 0.5, -0.0, f64::from_bits(1)] {
                let mut inputs = vec![0.0; length];
                inputs[place] = value;
                assert!(keys.insert(key(&inputs)), "{inputs:?}");
            }
        }
        assert!(keys.insert(key(&vec![0.0; length])), "{length}");
    }
    assert!(keys.insert(key(&[1.0, 2.0, 3.0, 4.0, 5.0])) && keys.insert(key(&[5.0, 2.0, 3.0, 4.0, 1.0])));
}

#[test]
fn answers_to_the_same_inputs_are_joined() {
    let mut cache = Cache::new(2, true);
    store(&mut cache, 1.0, &mut results_with_value(1.0));
    let mut gradient = IntervalResults::default();
    gradient.lambda.set(1)[0] = 5.0;
    gradient.gradient.set(1)[0] = 50.0;
    store(&mut cache, 1.0, &mut gradient);
    let entry = find(&cache, 1.0).unwrap();
    assert_eq!((entry.value.get().unwrap()[0], entry.gradient.get().unwrap()[0]), (1.0, 50.0));
    // A Hessian for other multipliers replaces the gradient for the former ones.
    let mut hessian = IntervalResults::default();
    hessian.lambda.set(1)[0] = 6.0;
    hessian.hessian.set(1)[0] = 600.0;
    store(&mut cache, 1.0, &mut hessian);
    let entry = find(&cache, 1.0).unwrap();
    assert!(entry.gradient.get().is_none());
    assert_eq!((entry.lambda.get().unwrap()[0], entry.hessian.get().unwrap()[0]), (6.0, 600.0));
}

#[test]
fn derivatives_are_kept_from_when_some_are_asked_for_again() {
    let derivative = |lambda: f64| {
        let mut answer = results_with_value(1.0);
        answer.jacobian.set(1)[0] = 2.0;
        answer.lambda.set(1)[0] = lambda;
        answer.hessian.set(1)[0] = 3.0;
        answer
    };
    for (jacobian, lambda, again) in
        [(false, 6.0, false), (false, 5.0, true), (true, 6.0, true), (false, -5.0, false)]
    {
        let mut cache = Cache::new(4, false);
        store(&mut cache, 1.0, &mut derivative(5.0));
        let entry = find(&cache, 1.0).unwrap();
        assert!(entry.value.get().is_some() && entry.jacobian.get().is_none());
        // Derivatives for other inputs were not computed before.
        cache.record_miss(key(&[2.0]), &[2.0], true, Some(&[5.0]));
        store(&mut cache, 1.0, &mut derivative(5.0));
        assert!(find(&cache, 1.0).unwrap().hessian.get().is_none());

        cache.record_miss(key(&[1.0]), &[1.0], jacobian, Some(&[lambda]));
        store(&mut cache, 1.0, &mut derivative(5.0));
        let entry = find(&cache, 1.0).unwrap();
        assert_eq!(entry.jacobian.get().is_some(), again, "{jacobian} {lambda}");
        assert_eq!(entry.hessian.get().is_some(), again, "{jacobian} {lambda}");
    }
}
