//! Pipeline barriers as a pure function of the accesses that passes declare; tested without a device.
//!
//! Read the Vulkan specification, chapter Synchronization and Cache Control. One rule per hazard: a read after a write
//! waits for the write and makes it visible once per reading stage; a write waits for every earlier read and write; a
//! layout transition counts as a write.

use std::collections::HashMap;

use ash::vk;

use super::access::{Access, Masks};

/// Identity of a buffer or an image.
pub type ResourceId = u64;

/// One use of one resource by one pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Use {
    /// The buffer or image.
    pub resource: ResourceId,
    /// Whether the resource is an image and has a layout.
    pub is_image: bool,
    /// The kind of access.
    pub access: Access,
    /// The shader stages that perform the access, for accesses of shaders.
    pub shaders: vk::ShaderStageFlags,
}

/// Synchronization state of a resource between two passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResourceState {
    layout: vk::ImageLayout,
    /// The last write: its stages, and the accesses that must be made available.
    write_stages: vk::PipelineStageFlags2,
    write_access: vk::AccessFlags2,
    /// Stages and accesses that already see the last write.
    visible_stages: vk::PipelineStageFlags2,
    visible_access: vk::AccessFlags2,
    /// Stages that have read since the last write.
    read_stages: vk::PipelineStageFlags2,
}

impl Default for ResourceState {
    fn default() -> Self {
        Self {
            layout: vk::ImageLayout::UNDEFINED,
            write_stages: vk::PipelineStageFlags2::NONE,
            write_access: vk::AccessFlags2::NONE,
            visible_stages: vk::PipelineStageFlags2::NONE,
            visible_access: vk::AccessFlags2::NONE,
            read_stages: vk::PipelineStageFlags2::NONE,
        }
    }
}

/// A pipeline barrier to record before a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Barrier {
    /// The resource that the barrier guards.
    pub resource: ResourceId,
    /// Source stages: the barrier waits for them.
    pub src_stages: vk::PipelineStageFlags2,
    /// Source accesses: the writes that the barrier makes available.
    pub src_access: vk::AccessFlags2,
    /// Destination stages: they wait for the barrier.
    pub dst_stages: vk::PipelineStageFlags2,
    /// Destination accesses: the accesses that see the writes.
    pub dst_access: vk::AccessFlags2,
    /// Layout before and after, for images.
    pub layouts: Option<(vk::ImageLayout, vk::ImageLayout)>,
}

/// The pipeline barriers before each pass, from each pass's uses in execution order.
///
/// `states` holds the state of each resource before the first pass (absent: never used), and after the call the state
/// after the last pass.
pub fn barriers(passes: &[Vec<Use>], states: &mut HashMap<ResourceId, ResourceState>) -> Vec<Vec<Barrier>> {
    passes
        .iter()
        .map(|uses| {
            merged(uses)
                .into_iter()
                .filter_map(|(resource, is_image, masks)| {
                    step(resource, is_image, masks, states.entry(resource).or_default())
                })
                .collect()
        })
        .collect()
}

/// One entry per resource, in order of first use: a read and a write of a resource in one pass are one access.
fn merged(uses: &[Use]) -> Vec<(ResourceId, bool, Masks)> {
    let mut all: Vec<(ResourceId, bool, Masks)> = Vec::new();
    for usage in uses {
        let masks = usage.access.masks(usage.shaders);
        match all.iter_mut().find(|(resource, ..)| *resource == usage.resource) {
            Some((.., known)) => {
                known.stages |= masks.stages;
                known.access |= masks.access;
                known.writes |= masks.writes;
                if known.layout != masks.layout {
                    // The only legal mixture is a depth image that one pass tests and samples (DEPTH_READ_ONLY allows
                    // both). Any other mixture is a bug of the caller.
                    let depth = vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL;
                    let sampled = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
                    let legal =
                        [(depth, sampled), (sampled, depth)].contains(&(known.layout, masks.layout)) || !usage.is_image;
                    assert!(legal, "one pass uses an image in layouts {:?} and {:?}", known.layout, masks.layout);
                    known.layout = depth;
                }
            }
            None => all.push((usage.resource, usage.is_image, masks)),
        }
    }
    all
}

fn step(resource: ResourceId, is_image: bool, masks: Masks, state: &mut ResourceState) -> Option<Barrier> {
    let relayout = is_image && state.layout != masks.layout;
    let barrier = |src_stages, src_access, layouts| Barrier {
        resource,
        src_stages,
        src_access,
        dst_stages: masks.stages,
        dst_access: masks.access,
        layouts,
    };
    if masks.writes || relayout {
        let src_stages = state.write_stages | state.read_stages;
        let needed = relayout || !src_stages.is_empty();
        let layouts = is_image.then_some((state.layout, masks.layout));
        let needed = needed.then(|| barrier(src_stages, state.write_access, layouts));
        *state = ResourceState {
            layout: if is_image { masks.layout } else { vk::ImageLayout::UNDEFINED },
            write_stages: masks.stages,
            // A transition alone leaves nothing to flush: its write is visible to the access that caused it.
            write_access: if masks.writes { write_part(masks.access) } else { vk::AccessFlags2::NONE },
            visible_stages: if masks.writes { vk::PipelineStageFlags2::NONE } else { masks.stages },
            visible_access: if masks.writes { vk::AccessFlags2::NONE } else { masks.access },
            read_stages: vk::PipelineStageFlags2::NONE,
        };
        return needed;
    }
    let seen = state.visible_stages.contains(masks.stages) && state.visible_access.contains(masks.access);
    state.read_stages |= masks.stages;
    if state.write_stages.is_empty() || seen {
        return None;
    }
    state.visible_stages |= masks.stages;
    state.visible_access |= masks.access;
    // The state says that every access in it sees the write in every stage of it: so the barrier makes it.
    Some(Barrier {
        dst_stages: state.visible_stages,
        dst_access: state.visible_access,
        ..barrier(state.write_stages, state.write_access, is_image.then_some((state.layout, state.layout)))
    })
}

/// The write accesses among `access`: only writes have to be made available.
fn write_part(access: vk::AccessFlags2) -> vk::AccessFlags2 {
    use vk::AccessFlags2 as A;
    access
        & (A::COLOR_ATTACHMENT_WRITE | A::DEPTH_STENCIL_ATTACHMENT_WRITE | A::SHADER_STORAGE_WRITE | A::TRANSFER_WRITE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usage(resource: ResourceId, access: Access) -> Use {
        let image = matches!(access, Access::ColorTarget | Access::DepthTarget | Access::DepthRead | Access::Sampled);
        Use { resource, is_image: image, access, shaders: vk::ShaderStageFlags::COMPUTE }
    }

    fn count(passes: &[Vec<Use>]) -> Vec<usize> {
        barriers(passes, &mut HashMap::new()).iter().map(Vec::len).collect()
    }

    #[test]
    fn a_buffer_read_after_a_write_waits_once_per_stage() {
        let write = vec![usage(1, Access::StorageWrite)];
        let read = vec![usage(1, Access::StorageRead)];
        assert_eq!(count(&[write, read.clone(), read]), [0, 1, 0]);
    }

    #[test]
    fn a_write_waits_for_earlier_reads_and_writes() {
        let write = vec![usage(1, Access::StorageWrite)];
        let read = vec![usage(1, Access::StorageRead)];
        let all = barriers(&[write.clone(), write.clone(), read, write], &mut HashMap::new());
        assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [0, 1, 1, 1]);
        assert_eq!(all[3][0].src_stages, vk::PipelineStageFlags2::COMPUTE_SHADER);
    }

    #[test]
    fn a_write_is_visible_to_all_that_the_state_says() {
        let by = |access, shaders| vec![Use { resource: 1, is_image: false, access, shaders }];
        let (fragment, compute) = (vk::ShaderStageFlags::FRAGMENT, vk::ShaderStageFlags::COMPUTE);
        let passes = [
            by(Access::StorageWrite, compute),
            by(Access::UniformRead, fragment),
            by(Access::StorageRead, compute),
            by(Access::StorageRead, fragment),
        ];
        let all = barriers(&passes, &mut HashMap::new());
        assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [0, 1, 1, 0]);
        assert!(all[2][0].dst_stages.contains(vk::PipelineStageFlags2::FRAGMENT_SHADER));
    }

    #[test]
    fn reads_of_untouched_buffers_need_nothing() {
        assert_eq!(count(&[vec![usage(1, Access::UniformRead)], vec![usage(1, Access::IndexRead)]]), [0, 0]);
    }

    #[test]
    fn an_image_changes_layout_between_target_and_sampled() {
        let all =
            barriers(&[vec![usage(7, Access::ColorTarget)], vec![usage(7, Access::Sampled)]], &mut HashMap::new());
        let [first, second] = [all[0][0], all[1][0]];
        assert_eq!(first.layouts, Some((vk::ImageLayout::UNDEFINED, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)));
        assert_eq!(second.src_access, vk::AccessFlags2::COLOR_ATTACHMENT_WRITE);
        assert_eq!(second.dst_access, vk::AccessFlags2::SHADER_SAMPLED_READ);
    }

    #[test]
    fn depth_may_be_tested_and_sampled_in_one_pass() {
        let all = barriers(&[vec![usage(3, Access::DepthRead), usage(3, Access::Sampled)]], &mut HashMap::new());
        assert_eq!(all[0].len(), 1);
        assert_eq!(all[0][0].layouts.map(|l| l.1), Some(vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL));
    }

    #[test]
    fn a_second_frame_starts_where_the_first_ended() {
        let mut states = HashMap::new();
        barriers(&[vec![usage(1, Access::StorageWrite)]], &mut states);
        let next = barriers(&[vec![usage(1, Access::StorageRead)]], &mut states);
        assert_eq!(next[0].len(), 1);
    }

    #[test]
    fn a_reader_in_another_stage_gets_its_own_barrier() {
        let write = vec![usage(1, Access::StorageWrite)];
        let compute = vec![usage(1, Access::StorageRead)];
        let index = vec![usage(1, Access::IndexRead)];
        assert_eq!(count(&[write, compute, index.clone(), index]), [0, 1, 1, 0]);
    }
}
