use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// The most recently found values by key.
#[derive(Debug)]
pub(super) struct Recent<K, V> {
    most: usize,
    kept: Mutex<VecDeque<(K, Arc<V>)>>,
}

impl<K: PartialEq, V> Recent<K, V> {
    pub fn new(most: usize) -> Self {
        Self { most, kept: Mutex::default() }
    }

    /// Returns a kept value, or finds it. Concurrent callers wait, and often get what was found meanwhile.
    pub fn get<E>(&self, key: K, find: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, value)) = kept.iter().find(|(known, _)| *known == key) {
            return Ok(Arc::clone(value));
        }
        let value = Arc::new(find()?);
        kept.truncate(self.most - 1);
        kept.push_front((key, Arc::clone(&value)));
        Ok(value)
    }
}
