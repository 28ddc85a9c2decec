//! Copy-on-write lists: clones of a scene share them until one clone changes its own.

use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Weak};

/// A copy-on-write list: a clone increments a reference count, and a change of a shared list copies it.
///
/// ```
/// use etalon_scene::Shared;
/// let a: Shared<u32> = vec![1, 2].into();
/// let mut b = a.clone();
/// assert!(a.is_same(&b));
/// b.push(3);
/// assert_eq!((&a[..], &b[..]), (&[1, 2][..], &[1, 2, 3][..]));
/// ```
#[derive(Debug)]
pub struct Shared<T>(Arc<Vec<T>>);

impl<T> Shared<T> {
    /// Whether both are the same list in memory.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// An identity of this list in memory that is never reused, even after the list is dropped.
    #[must_use]
    pub fn mark(&self) -> Mark<T> {
        Mark(Arc::downgrade(&self.0))
    }
}

/// Identity of a list in memory: equal marks belong to one list. A mark does not keep the list alive.
#[derive(Debug, Clone)]
pub struct Mark<T>(Weak<Vec<T>>);

impl<T> PartialEq for Mark<T> {
    fn eq(&self, other: &Self) -> bool {
        Weak::ptr_eq(&self.0, &other.0)
    }
}

impl<T> AsRef<[T]> for Shared<T> {
    fn as_ref(&self) -> &[T] {
        self
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T> Deref for Shared<T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T: Clone> DerefMut for Shared<T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        Arc::make_mut(&mut self.0)
    }
}

impl<T> From<Vec<T>> for Shared<T> {
    fn from(list: Vec<T>) -> Self {
        Self(Arc::new(list))
    }
}

impl<T: PartialEq, L: AsRef<[T]>> PartialEq<L> for Shared<T> {
    fn eq(&self, other: &L) -> bool {
        self[..] == *other.as_ref()
    }
}

impl<T> FromIterator<T> for Shared<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        Vec::from_iter(items).into()
    }
}

impl<'a, T> IntoIterator for &'a Shared<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, T: Clone> IntoIterator for &'a mut Shared<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}
