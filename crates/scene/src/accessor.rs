//! glTF accessors: typed data from buffers, with every byte range checked before reading (glTF 2.0 sections 3.6.2 and
//! 3.11).

use anyhow::{Context, Result, bail, ensure};
use gltf::json::{
    accessor::{ComponentType, Type},
    validation::Checked,
};

use super::document::Document;

/// Largest size in bytes of an accessor without a buffer view: its zeros take no space in the file, so the file size
/// does not bound them.
const MAX_IMPLIED_BYTES: u64 = 256 << 20;

/// An accessor whose byte ranges lie inside their buffers.
pub(crate) struct Accessor<'a> {
    index: usize,
    /// Number of elements.
    pub(crate) count: usize,
    component: ComponentType,
    shape: Type,
    normalized: bool,
    /// Bytes from the first element on, and the distance between elements; `None` means zeros.
    base: Option<(&'a [u8], usize)>,
    sparse: Option<Sparse<'a>>,
}

struct Sparse<'a> {
    indices: Vec<usize>,
    values: &'a [u8],
}

/// Size in bytes of one element and of one of its columns: matrix columns start at multiples of four bytes.
fn element_size(shape: Type, component: ComponentType) -> usize {
    let size = component.size();
    match shape {
        Type::Mat2 => 2 * (2 * size).next_multiple_of(4),
        Type::Mat3 => 3 * (3 * size).next_multiple_of(4),
        _ => size * shape.multiplicity(),
    }
}

/// The byte range of `count` elements of `size` bytes, every `stride` bytes from `offset` on. The error names the
/// fault.
fn window<'a>(
    what: &str,
    view: usize,
    bytes: &'a [u8],
    offset: u64,
    count: usize,
    stride: usize,
    size: usize,
) -> Result<&'a [u8]> {
    if count == 0 {
        return Ok(&[]);
    }
    let length = (count as u64 - 1).checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64));
    let end = length.and_then(|n| n.checked_add(offset));
    match end {
        Some(end) if end <= bytes.len() as u64 => Ok(&bytes[offset as usize..end as usize]),
        _ => bail!(
            "{what} reads {count} elements from byte {offset} up to byte {} of buffer view {view}, which has {} bytes",
            end.map_or_else(|| "2^64".to_owned(), |e| e.to_string()),
            bytes.len()
        ),
    }
}

impl<'a> Accessor<'a> {
    /// Looks up accessor `index` and checks all its ranges.
    pub(crate) fn new(document: &'a Document<'_>, index: usize) -> Result<Self> {
        let json = document.root.accessors.get(index).with_context(|| {
            format!("accessor {index} does not exist; the file has {}", document.root.accessors.len())
        })?;
        let (Checked::Valid(component), Checked::Valid(shape)) = (&json.component_type, &json.type_) else {
            bail!("accessor {index} has an unknown component type or shape");
        };
        let (component, shape) = (component.0, *shape);
        let size = element_size(shape, component);
        let count = usize::try_from(json.count.0).with_context(|| format!("accessor {index} is too long"))?;
        let base = match json.buffer_view {
            Some(view) => {
                let (bytes, stride) = document.view(view.value()).with_context(|| format!("accessor {index}"))?;
                let stride = stride.unwrap_or(size);
                ensure!(
                    stride >= size,
                    "accessor {index} has elements of {size} bytes, but a stride of {stride} bytes"
                );
                let offset = json.byte_offset.unwrap_or_default().0;
                let what = format!("accessor {index}");
                Some((window(&what, view.value(), bytes, offset, count, stride, size)?, stride))
            }
            None => {
                ensure!(
                    json.count.0.saturating_mul(size as u64) <= MAX_IMPLIED_BYTES,
                    "accessor {index} claims {count} elements without a buffer view, more than {MAX_IMPLIED_BYTES} bytes of zeros"
                );
                None
            }
        };
        let sparse = match &json.sparse {
            Some(sparse) => {
                let n = usize::try_from(sparse.count.0).with_context(|| format!("accessor {index} is too long"))?;
                ensure!(n <= count, "accessor {index} has {count} elements, but {n} sparse ones");
                let view = sparse.indices.buffer_view.value();
                let (bytes, _) = document.view(view).with_context(|| format!("accessor {index}"))?;
                let Checked::Valid(kind) = &sparse.indices.component_type else {
                    bail!("the sparse indices of accessor {index} have an unknown component type");
                };
                let step = kind.0.size();
                let what = format!("the sparse index list of accessor {index}");
                let raw = window(&what, view, bytes, sparse.indices.byte_offset.0, n, step, step)?;
                let indices: Vec<usize> =
                    raw.chunks_exact(step).map(|c| c.iter().rev().fold(0, |v, &b| v << 8 | usize::from(b))).collect();
                if let Some(bad) = indices.iter().find(|&&i| i >= count) {
                    bail!("the sparse index list of accessor {index} names element {bad} of {count}");
                }
                let view = sparse.values.buffer_view.value();
                let (bytes, _) = document.view(view).with_context(|| format!("accessor {index}"))?;
                let what = format!("the sparse value list of accessor {index}");
                let values = window(&what, view, bytes, sparse.values.byte_offset.0, n, size, size)?;
                Some(Sparse { indices, values })
            }
            None => None,
        };
        Ok(Self { index, count, component, shape, normalized: json.normalized, base, sparse })
    }

    /// Elements as `N` floats: normalised integers become fractions, other integers keep their value.
    pub(crate) fn floats<const N: usize>(&self) -> Result<Vec<[f32; N]>> {
        let expected = match N {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            4 => Type::Vec4,
            _ => Type::Mat4,
        };
        ensure!(self.shape == expected, "accessor {} holds {:?} elements, not {expected:?}", self.index, self.shape);
        let mut out = vec![[0.0; N]; self.count];
        self.components(out.as_flattened_mut());
        Ok(out)
    }

    /// Writes all components as floats to `out`, element after element.
    fn components(&self, out: &mut [f32]) {
        use ComponentType::{F32, I8, I16, U8, U16, U32};
        match (self.component, self.normalized) {
            (F32, _) => match (self.base, &self.sparse) {
                // Tightly packed floats, the usual case.
                (Some((bytes, _)), None) if cfg!(target_endian = "little") && bytes.len() == size_of_val(out) => {
                    bytemuck::cast_slice_mut::<f32, u8>(out).copy_from_slice(bytes);
                }
                _ => self.decode(out, f32::from_le_bytes),
            },
            (I8, true) => self.decode(out, |b: [u8; 1]| (f32::from(i8::from_le_bytes(b)) / 127.0).max(-1.0)),
            (U8, true) => self.decode(out, |b: [u8; 1]| f32::from(b[0]) / 255.0),
            (I16, true) => self.decode(out, |b: [u8; 2]| (f32::from(i16::from_le_bytes(b)) / 32767.0).max(-1.0)),
            (U16, true) => self.decode(out, |b: [u8; 2]| f32::from(u16::from_le_bytes(b)) / 65535.0),
            (U32, true) => {
                self.decode(out, |b: [u8; 4]| (f64::from(u32::from_le_bytes(b)) / f64::from(u32::MAX)) as f32)
            }
            (I8, false) => self.decode(out, |b: [u8; 1]| f32::from(i8::from_le_bytes(b))),
            (U8, false) => self.decode(out, |b: [u8; 1]| f32::from(b[0])),
            (I16, false) => self.decode(out, |b: [u8; 2]| f32::from(i16::from_le_bytes(b))),
            (U16, false) => self.decode(out, |b: [u8; 2]| f32::from(u16::from_le_bytes(b))),
            (U32, false) => self.decode(out, |b: [u8; 4]| u32::from_le_bytes(b) as f32),
        }
    }

    /// All numbers of the elements one after the other, converted as [`Accessor::floats`] does.
    pub(crate) fn numbers(&self) -> Result<Vec<f32>> {
        match self.shape {
            Type::Scalar | Type::Vec2 | Type::Vec3 | Type::Vec4 => {
                let mut out = vec![0.0; self.count * self.shape.multiplicity()];
                self.components(&mut out);
                Ok(out)
            }
            other => bail!("accessor {} holds {other:?} elements, not numbers or vectors", self.index),
        }
    }

    /// Vertex colours: three or four components; alpha is 1 with three.
    pub(crate) fn colors(&self) -> Result<Vec<[f32; 4]>> {
        match self.shape {
            Type::Vec3 => Ok(self.floats::<3>()?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()),
            _ => self.floats::<4>(),
        }
    }

    /// Elements as one unsigned integer each.
    pub(crate) fn indices(&self) -> Result<Vec<u32>> {
        ensure!(self.shape == Type::Scalar, "accessor {} holds {:?} elements, not indices", self.index, self.shape);
        let mut out = vec![0; self.count];
        match self.component {
            ComponentType::U8 => self.decode(&mut out, |b: [u8; 1]| u32::from(b[0])),
            ComponentType::U16 => self.decode(&mut out, |b: [u8; 2]| u32::from(u16::from_le_bytes(b))),
            ComponentType::U32 => self.decode(&mut out, u32::from_le_bytes),
            other => bail!("accessor {} holds {other:?} components, not unsigned indices", self.index),
        }
        Ok(out)
    }

    /// Joint indices, four per element.
    pub(crate) fn joints(&self) -> Result<Vec<[u16; 4]>> {
        ensure!(self.shape == Type::Vec4, "accessor {} holds {:?} elements, not joints", self.index, self.shape);
        let mut out = vec![[0; 4]; self.count];
        match self.component {
            ComponentType::U8 => self.decode(out.as_flattened_mut(), |b: [u8; 1]| u16::from(b[0])),
            ComponentType::U16 => self.decode(out.as_flattened_mut(), u16::from_le_bytes),
            other => bail!("accessor {} holds {other:?} components, not joint numbers", self.index),
        }
        Ok(out)
    }

    /// Writes all components to `out`, which holds zeros, element after element.
    fn decode<const SIZE: usize, T>(&self, out: &mut [T], component: impl Fn([u8; SIZE]) -> T) {
        let n = self.shape.multiplicity();
        let write = |element: &mut [T], bytes: &[u8]| {
            for (value, chunk) in element.iter_mut().zip(bytes.as_chunks::<SIZE>().0) {
                *value = component(*chunk);
            }
        };
        if let Some((bytes, stride)) = self.base {
            out.chunks_exact_mut(n).zip(bytes.chunks(stride)).for_each(|(element, bytes)| write(element, bytes));
        }
        if let Some(sparse) = &self.sparse {
            let values = sparse.values.chunks_exact(n * SIZE);
            sparse.indices.iter().zip(values).for_each(|(&i, bytes)| write(&mut out[i * n..][..n], bytes));
        }
    }
}
