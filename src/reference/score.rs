//! stub until merge
/// x
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewScore {
    /// Σ c over pixels.
    pub contribution: Vec<f32>,
    /// Σ c² over pixels.
    pub energy: Vec<f32>,
    /// removal
    pub removal: Vec<f32>,
}
impl ViewScore {
    /// No contribution.
    pub fn zeros(count: usize) -> Self {
        Self { contribution: vec![0.0; count], energy: vec![0.0; count], removal: vec![0.0; count] }
    }
}
