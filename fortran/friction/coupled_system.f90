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

  !> Multiply by the matrix of (F7).
  subroutine coupled_product(self, x, y, error)
    class(coupled_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: p(:), along_t(:)
    integer :: n

    n = size(x)/3
    allocate (p(self%pressed%n_active), along_t(self%pressed%n_active))
    call self%pressed%pack(x(:n), p)
    call self%pressed%pack(x(n + 1:2*n), along_t)
    call self%space%copy(x, y)
    call displace(self, p, along_t, y, error)
  end subroutine coupled_product

  !> Multiply values at the active nodes: pressure and component along t of all nodes in contact, that along e of some.
  subroutine coupled_product_packed(self, nodes, x, y, error)
    class(coupled_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    call self%space%fill(y, 0.0_wp)
    call nodes%unpack(x, y)
    associate (n => self%pressed%n_active)
      call displace(self, x(:n), x(n + 1:2*n), y, error)
    end associate
  end subroutine coupled_product_packed

  !> Compute the displacements by tractions, in their place, with the stretch of the springs.
  subroutine displace(self, p, along_t, values, error)
    class(coupled_system_t), intent(inout) :: self
    !> Pressure and component along t of the nodes in contact
    real(wp), intent(in), contiguous :: p(:), along_t(:)
    !> Tractions, then displacements (3 n)
    real(wp), intent(inout), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: n, k, i

    n = size(values)/3
    call self%add_slope(values(:n), values(2*n + 1:))
    call self%shear%turn(values(n + 1:))
    call self%operators%replace([normal, along_x, along_y], values, error)
    if (allocated(error)) return
    if (allocated(self%compliance)) then
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i)
      do k = 1, size(self%pressed%first)
        do i = self%pressed%first(k), self%pressed%last(k)
          values(i) = values(i) + self%compliance(i)*p(self%pressed%place(k) + i - self%pressed%first(k))
        end do
      end do
      !$omp end parallel do
    end if
    call self%shear%add_springs(along_t, values(n + 1:))
    call self%add_tilt(-1.0_wp, p, values(n + 1:2*n))
  end subroutine displace

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
    !> Pressure (n), or that of the nodes in contact alone
    real(wp), intent(in), contiguous :: p(:)
    !> Displacement along t (n)
    real(wp), intent(inout), contiguous :: y(:)
    integer :: k, i, at
    logical :: packed

    if (.not. allocated(self%tilt)) return
    packed = size(p) < size(y)
    associate (contact => self%pressed)
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, at)
      do k = 1, size(contact%first)
        do i = contact%first(k), contact%last(k)
          at = contact%place(k) + i - contact%first(k)
          y(i) = y(i) + factor*(self%shear%compliance(at)*self%tilt(at)*p(merge(at, i, packed)))
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine add_tilt

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
