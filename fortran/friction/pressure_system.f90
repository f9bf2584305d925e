!> The linear problem of the pressure on the nodes in contact, w = K p, for conjugate gradients ((F9) of
!> docs/theory/friction.md).
module hc_pressure_system
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_flexibility, only: normal
  use hc_preconditioner_extension, only: edge_extension_t, new_edge_extension
  use hc_elastic_operators, only: operators_t
  use hc_linear_system, only: linear_system_t
  implicit none
  private

  public :: pressure_system_t

  !> Pressure on the nodes in contact.
  type, extends(linear_system_t) :: pressure_system_t
    type(operators_t), pointer :: operators => null()
    !> Continuation of displacements beyond the contact
    type(edge_extension_t) :: edge
  contains
    !> Take the nodes in contact
    procedure :: take => take_contact
    procedure :: product => pressure_product
    procedure :: precondition => pressure_precondition
  end type pressure_system_t

contains

  !> Take the nodes in contact.
  subroutine take_contact(self, contact)
    class(pressure_system_t), intent(inout) :: self
    !> Nodes in contact (n)
    logical, intent(in) :: contact(:)

    call new_edge_extension(self%edge, reshape(contact, self%operators%flexibility%lattice%extent), self%operators%space)
  end subroutine take_contact

  subroutine pressure_product(self, x, y, error)
    class(pressure_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    call self%operators%apply([normal], x, [normal], y, error)
  end subroutine pressure_product

  subroutine pressure_precondition(self, x, y, error)
    class(pressure_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    call self%operators%precondition_pressure(self%edge, x, y)
  end subroutine pressure_precondition

end module hc_pressure_system
