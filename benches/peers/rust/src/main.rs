mod export;
fn main() {
    println!("{}", serde_json::json!({"lanes": export::coefficients(), "samples": export::samples()}));
}
