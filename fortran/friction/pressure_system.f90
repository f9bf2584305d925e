!> The linear problem of the pressure on the nodes in contact, w = K p, for conjugate gradients ((F9) of
!> docs/theory/friction.md); under a compliant law of contact, w = (K + C) p with the springs of its linearisation.
module hc_pressure_system
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_flexibility, only: normal
  use hc_operator_set, only: traction_system_t
  use hc_active_set, only: active_set_t
  implicit none
  private

  public :: pressure_system_t

  !> Pressure on the nodes in contact.
  type, extends(traction_system_t) :: pressure_system_t
    !> Compliance C [m/Pa] and offset [m] of the spring of each node, 0 off the contact; not there without a compliant law
    real(wp), allocatable :: compliance(:), offset(:)
  contains
    !> Add the compression of the springs to displacements, or subtract it
    procedure :: stretch
    procedure :: product => pressure_product
    procedure :: product_packed => pressure_product_packed
    procedure :: precondition_packed => pressure_precondition_packed
  end type pressure_system_t

contains

  !> Multiply by the normal flexibility with the springs of the law of contact.
  subroutine pressure_product(self, x, y, error)
    class(pressure_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    call self%operators%apply([normal], x, [normal], y, error)
    call self%stretch(1.0_wp, x, y)
  end subroutine pressure_product

  !> Multiply values at the active nodes.
  subroutine pressure_product_packed(self, nodes, x, y, error)
    class(pressure_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: k, i

    call self%space%fill(y, 0.0_wp)
    call nodes%unpack(x, y)
    call self%operators%replace([normal], y, error)
    if (allocated(error) .or. .not. allocated(self%compliance)) return
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i)
    do k = 1, size(nodes%first)
      do i = nodes%first(k), nodes%last(k)
        y(i) = y(i) + self%compliance(i)*x(nodes%place(k) + i - nodes%first(k))
      end do
    end do
    !$omp end parallel do
  end subroutine pressure_product_packed

  !> Add to y: y <- y + factor C x
  subroutine stretch(self, factor, x, y)
    class(pressure_system_t), intent(in) :: self
    !> 1 to add, -1 to take off
    real(wp), intent(in) :: factor
    !> Pressure [Pa], and closing of the gap [m]
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(inout), contiguous :: y(:)
    integer :: i

    if (.not. allocated(self%compliance)) return
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, size(x)
      y(i) = y(i) + factor*self%compliance(i)*x(i)
    end do
    !$omp end parallel do
  end subroutine stretch

  !> Apply the preconditioner of the pressure.
  subroutine pressure_precondition_packed(self, nodes, n, r, z)
    class(pressure_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)

    associate (operators => self%operators)
      call operators%normal%apply_packed(nodes, n, r, z, operators%preconditioning)
    end associate
  end subroutine pressure_precondition_packed

end module hc_pressure_system
