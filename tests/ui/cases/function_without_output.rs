use casados::function;

#[function]
fn nothing(x: [f64; 2]) {
    let _ = x;
}

fn main() {}
