//! How a scanner has moved between two clouds of the same surface: point-to-plane registration with projective association.
//!
//! In: two [`OrganizedSurface`]s, each in the frame of camera 1 as it stood, and a rough pose between them. Out: the
//! [`Registration`], that is the pose, its covariance and how well it fits, or a [`Lost`] with its reason. A point of one
//! surface is projected with the pose into the image of C1 that the other was seen in, and paired with what stands at that
//! pixel (Blais and Levine 1995, "Registering multiview range data to create 3D computer objects"), so that no search tree
//! is needed; the distance to the plane there is made small (Chen and Medioni 1992, "Object modelling by registration of
//! multiple range images"), with weights by predicted noise and by a robust estimator, from few points to many.
//!
//! Normals cost about 0.1 µs a point, a registration of 8,000 points 9 ms of one core. Sums are formed over fixed
//! tiles of the image and added in their order: the same input gives the same bits for any number of threads.

mod association;
mod covariance;
mod equations;
mod icp;
mod normals;
mod outcome;
mod smooth_error;
mod surface;
mod thinning;

pub use covariance::PoseCovariance;
pub use icp::{register, register_loosely};
pub use outcome::{Lost, Registration, RegistrationSettings};
pub use surface::{OrganizedSurface, SurfacePoint};

#[cfg(test)]
pub(crate) mod tests;
