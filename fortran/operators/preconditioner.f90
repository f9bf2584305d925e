!> Abstract preconditioner of the linear problems of contact.
!>
!> The linear problems of contact are K x + D x = b on the active nodes: K is a part of the flexibility operator, D the
!> compliance of springs in series with the nodes. A preconditioner M is a symmetric positive definite estimate of
!> (K + D)^-1 there. The preconditioner of the whole library is that of symbol_preconditioner; another one extends this type and is
!> given to hc_operator_set or hc_normal_lattice in its place.
!>
!> Equations: docs/theory/preconditioner.md.
module hc_preconditioner
  use hc_precision, only: wp, sp, lk
  use hc_field_space, only: field_space_t
  use hc_active_set, only: active_set_t, new_active_set
  implicit none
  private

  public :: preconditioner_t

  !> Approximate inverse of the normal or of the tangential flexibility on the active nodes.
  type, abstract :: preconditioner_t
    !> Displacement per traction that numbers in single precision are scaled with [m/Pa]
    real(wp) :: unit = 1.0_wp
    !> The active nodes are many patches, as on rough surfaces
    logical :: patches = .false.
  contains
    !> Set the active nodes
    procedure(set_active), deferred :: set_active
    !> Estimate the traction at the active nodes that causes a displacement
    procedure(apply_packed), deferred :: apply_packed
    !> The same over all nodes, in single precision
    procedure :: apply_single
    !> Remove the active nodes, and free their arrays
    procedure :: clear
  end type preconditioner_t

  abstract interface
    !> Set the active nodes, and the springs in series with them.
    subroutine set_active(self, active, compliance, direction)
      import :: preconditioner_t, wp, lk
      class(preconditioner_t), intent(inout) :: self
      !> Active nodes (n)
      logical(lk), intent(in), contiguous :: active(:)
      !> Compliance D of the springs along the first component of a vector (n; with directions at the active nodes only); absent:
      !> no springs [m/Pa]. It has to outlive the applications
      real(wp), intent(in), optional, target, contiguous :: compliance(:)
      !> With two components: the second axis e of the frame (t, e) of each active node (2, n_active); it has to outlive the
      !> applications
      real(wp), intent(in), optional, target, contiguous :: direction(:, :)
    end subroutine set_active

    !> Compute z = M r at the active nodes.
    subroutine apply_packed(self, nodes, n, displacement, traction, work)
      import :: preconditioner_t, active_set_t, wp
      class(preconditioner_t), intent(inout) :: self
      !> Active nodes of a vector, and its length; a vector has one component after the other, shear in the frames
      type(active_set_t), intent(in) :: nodes
      integer, intent(in) :: n
      !> Displacement [m], and the traction that causes it [Pa], at the active nodes
      real(wp), intent(in), contiguous :: displacement(:)
      real(wp), intent(inout), contiguous :: traction(:)
      !> Work so far, in applications of the full flexibility operator; this one is added
      real(wp), intent(inout) :: work
    end subroutine apply_packed
  end interface

contains

  !> Compute z = M r in single precision, in units of displacement and traction of the ratio `unit`; z is used on the active
  !> nodes only.
  subroutine apply_single(self, displacement, traction, work)
    class(preconditioner_t), intent(inout) :: self
    !> Displacement, zero off the active nodes, where values may change (n or 2 n)
    real(sp), intent(inout), contiguous, target :: displacement(:)
    !> Traction that causes it (n or 2 n)
    real(sp), intent(out), contiguous, target :: traction(:)
    !> Work so far, in applications of the full flexibility operator; this one is added
    real(wp), intent(inout) :: work
    real(wp), allocatable :: wanted(:)
    type(active_set_t) :: nodes

    call new_active_set(nodes, spread(.true._lk, 1, size(displacement)), field_space_t())
    allocate (wanted(size(traction)))
    call self%apply_packed(nodes, size(displacement), self%unit*displacement, wanted, work)
    traction = real(wanted, sp)
  end subroutine apply_single

  !> Forget the active nodes: by default nothing is stored for them.
  subroutine clear(self)
    class(preconditioner_t), intent(inout) :: self

  end subroutine clear

end module hc_preconditioner
