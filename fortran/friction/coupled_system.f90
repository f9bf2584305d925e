!> The linear problem of pressure and shear traction together, for GMRES ((F7) of docs/theory/friction.md).
module hc_coupled_system
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_flexibility, only: normal, along_x, along_y
  use hc_preconditioner_extension, only: edge_extension_t
  use hc_elastic_operators, only: operators_t
  use hc_shear_system, only: shear_system_t
  use hc_linear_system, only: linear_system_t
  implicit none
  private

  public :: coupled_system_t

  !> Pressure and shear traction together: the pressure of a slipping node carries mu p e along.
  !>
  !> Its matrix is not symmetric. A vector is the pressure, then the shear in the frames.
  type, extends(linear_system_t) :: coupled_system_t
    type(operators_t), pointer :: operators => null()
    !> Frames and compliances of the nodes
    type(shear_system_t), pointer :: shear => null()
    !> Continuation of displacements beyond the contact
    type(edge_extension_t) :: edge
    !> mu at slipping nodes, 0 elsewhere
    real(wp), allocatable :: slope(:)
  contains
    procedure :: product => coupled_product
    procedure :: precondition => coupled_precondition
  end type coupled_system_t

contains

  subroutine coupled_product(self, x, y, error)
    class(coupled_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: frame(:), traction(:), moved(:)
    integer :: n, i

    n = size(x)/3
    allocate (frame(2*n), traction(3*n), moved(3*n))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      frame(i) = x(n + i)
      frame(n + i) = x(2*n + i) + self%slope(i)*x(i)
      traction(i) = x(i)
    end do
    !$omp end parallel do
    call self%shear%to_plane(frame, traction(n + 1:))
    call self%operators%apply([normal, along_x, along_y], traction, [normal, along_x, along_y], moved, error)
    if (allocated(error)) return
    call self%space%copy(moved(:n), y(:n))
    call self%shear%to_frame(moved(n + 1:), y(n + 1:))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      y(n + i) = y(n + i) + self%shear%compliance(i)*x(n + i)
    end do
    !$omp end parallel do
  end subroutine coupled_product

  subroutine coupled_precondition(self, x, y, error)
    class(coupled_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: n

    n = size(x)/3
    call self%operators%precondition_pressure(self%edge, x(:n), y(:n))
    call self%shear%precondition(x(n + 1:), y(n + 1:), error)
  end subroutine coupled_precondition

end module hc_coupled_system
