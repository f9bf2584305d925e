!> The linear problem of pressure and shear traction together, for GMRES ((F7) of docs/theory/friction.md).
module hc_coupled_system
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_flexibility, only: normal, along_x, along_y
  use hc_operator_set, only: traction_system_t
  use hc_shear_system, only: shear_system_t
  use hc_active_set, only: active_set_t
  implicit none
  private

  public :: coupled_system_t

  !> Pressure and shear traction together: the pressure of a slipping node carries mu p e along. Where the law has a direction,
  !> it moves the traction across at which the spring of the node rests, too.
  !>
  !> Its matrix is not symmetric. A vector is the pressure, then the shear in the frames.
  type, extends(traction_system_t) :: coupled_system_t
    !> Frames and compliances of the nodes
    type(shear_system_t), pointer :: shear => null()
    !> Nodes in contact, and unknowns of the shear traction (of 2 n)
    type(active_set_t), pointer :: pressed => null(), sheared => null()
    !> Compliance of the springs of a compliant law of contact; not there without [m/Pa]
    real(wp), allocatable :: compliance(:)
    !> Of the nodes in contact: mu where they slip, else 0; traction across at rest over the pressure, not there if all are 0
    real(wp), allocatable :: slope(:), tilt(:)
  contains
    procedure :: product => coupled_product
    procedure :: product_packed => coupled_product_packed
    procedure :: precondition_packed => coupled_precondition_packed
    !> Add the share of the pressure to the traction along e, and the stretch by its rest to the displacement along t
    procedure :: add_slope, add_tilt
  end type coupled_system_t

contains

  !> Multiply by the matrix of (F11).
  subroutine coupled_product(self, x, y, error)
    class(coupled_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: n

    n = size(x)/3
    call self%space%copy(x, y)
    call self%add_slope(x(:n), y(2*n + 1:))
    call self%shear%turn(y(n + 1:))
    call self%operators%replace([normal, along_x, along_y], y, error)
    if (allocated(error)) return
    if (allocated(self%compliance)) y(:n) = y(:n) + self%compliance*x(:n)
    call self%shear%add_springs(x(n + 1:), y(n + 1:))
    call self%add_tilt(-1.0_wp, x(:n), y(n + 1:2*n))
  end subroutine coupled_product

  !> Add y <- y + mu p along e of slipping nodes.
  subroutine add_slope(self, p, y)
    class(coupled_system_t), intent(in) :: self
    !> Pressure (n)
    real(wp), intent(in), contiguous :: p(:)
    !> Traction along e (n)
    real(wp), intent(inout), contiguous :: y(:)
    integer :: k, i

    associate (contact => self%pressed)
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i)
      do k = 1, size(contact%first)
        do i = contact%first(k), contact%last(k)
          y(i) = y(i) + self%slope(contact%place(k) + i - contact%first(k))*p(i)
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine add_slope

  !> Add y <- y + factor D tilt p along t of slipping nodes.
  subroutine add_tilt(self, factor, p, y)
    class(coupled_system_t), intent(in) :: self
    !> 1 or -1
    real(wp), intent(in) :: factor
    !> Pressure (n)
    real(wp), intent(in), contiguous :: p(:)
    !> Displacement along t (n)
    real(wp), intent(inout), contiguous :: y(:)
    integer :: k, i, at

    if (.not. allocated(self%tilt)) return
    associate (contact => self%pressed)
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, at)
      do k = 1, size(contact%first)
        do i = contact%first(k), contact%last(k)
          at = contact%place(k) + i - contact%first(k)
          y(i) = y(i) + factor*(self%shear%compliance(at)*self%tilt(at)*p(i))
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine add_tilt

  !> Multiply values at the active nodes: pressure and component along t of all nodes in contact, that along e of some.
  subroutine coupled_product_packed(self, nodes, x, y, error)
    class(coupled_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: e
    integer :: n, k, i, at

    n = size(y)/3
    call self%space%fill(y, 0.0_wp)
    associate (contact => self%pressed, runs => self%sheared%pairs, n_p => self%pressed%n_active, &
               n_t => self%sheared%pairs%n_first, direction => self%shear%direction)
      call self%shear%put_in_plane(runs, x(n_p + 1:n_p + n_t), x(n_p + n_t + 1:), y(n + 1:))
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, at, e)
      do k = 1, size(contact%first)
        do i = contact%first(k), contact%last(k)
          at = contact%place(k) + i - contact%first(k)
          y(i) = x(at)
          e = self%slope(at)*x(at)
          y(n + i) = y(n + i) + direction(1, at)*e
          y(2*n + i) = y(2*n + i) + direction(2, at)*e
        end do
      end do
      !$omp end parallel do
      call self%operators%replace([normal, along_x, along_y], y, error)
      if (allocated(error)) return
      call self%shear%add_springs(x(n_p + 1:n_p + n_t), y(n + 1:))
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, at)
      do k = 1, size(contact%first)
        do i = contact%first(k), contact%last(k)
          at = contact%place(k) + i - contact%first(k)
          if (allocated(self%compliance)) y(i) = y(i) + self%compliance(i)*x(at)
          if (allocated(self%tilt)) y(n + i) = y(n + i) - self%shear%compliance(at)*self%tilt(at)*x(at)
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine coupled_product_packed

  !> Precondition pressure and shear traction each by its own preconditioner, the shear traction after the pressure: where a
  !> law has a direction, the pressure moves the rest of springs, which are stiff where a node has slipped far.
  subroutine coupled_precondition_packed(self, nodes, n, r, z)
    class(coupled_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)
    real(wp), allocatable :: shear(:)
    integer :: k, i, at

    associate (contact => self%pressed, n_p => self%pressed%n_active, operators => self%operators)
      call operators%normal%apply_packed(contact, n/3, r(:n_p), z(:n_p), operators%preconditioning)
      if (.not. allocated(self%tilt)) then
        call self%shear%precondition_packed(self%sheared, 2*n/3, r(n_p + 1:), z(n_p + 1:))
        return
      end if
      shear = r(n_p + 1:)
      do k = 1, size(contact%first)
        do i = contact%first(k), contact%last(k)
          at = contact%place(k) + i - contact%first(k)
          shear(at) = shear(at) + self%shear%compliance(at)*self%tilt(at)*z(at)
        end do
      end do
      call self%shear%precondition_packed(self%sheared, 2*n/3, shear, z(n_p + 1:))
    end associate
  end subroutine coupled_precondition_packed

end module hc_coupled_system
