//! Memory of a message that is not sent yet.

// iceoryx2 hands out memory as uninitialized. Only the function `initialized` uses unsafe code.
#![allow(unsafe_code)]

use super::payload::Element;
use super::{Header, Ipc};

/// Elements that hold anything.
pub(super) type Uninitialized<H, E> = iceoryx2::sample_mut_uninit::SampleMutUninit<Ipc, [std::mem::MaybeUninit<E>], H>;
/// Elements of a message.
pub(super) type Written<H, E> = iceoryx2::sample_mut::SampleMut<Ipc, [E], H>;

/// Takes the elements as they are: those of an earlier message, or zero. To clear them would take as long as to set them.
pub(super) fn initialized<H: Header, E: Element>(loan: Uninitialized<H, E>) -> Written<H, E> {
    // SAFETY: the memory is a file mapped by the system, which has set all its bytes, and any bytes are valid elements.
    unsafe { loan.assume_init() }
}
