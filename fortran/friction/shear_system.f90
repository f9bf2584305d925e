!> The linear problem of the shear traction on the nodes in contact, for conjugate gradients ((F10) of
!> docs/theory/friction.md).
!>
!> Every node in contact has a frame (t, e); a sticking node carries both components of q, a slipping one tau in
!> q = mu p e + tau t and the compliance D along t. The matrix
!>
!>     R^T T R + D,     R: frame -> (x, y)
!>
!> is symmetric positive definite on these unknowns. Its preconditioner is the inverse symbol in stick, and goes
!> over to 1/D where a node slips far (symbol_preconditioner).
!>
!> A field with two components is one vector, first the one, then the other.
module hc_shear_system
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_flexibility, only: along_x, along_y
  use hc_inverse_symbol, only: node_compliance
  use hc_elastic_operators, only: operators_t
  use hc_linear_system, only: linear_system_t
  use hc_active_set, only: active_set_t, new_active_set, paired_runs_t, pair_runs
  implicit none
  private

  public :: shear_system_t, new_shear_system, slip_compliance_row

  !> Squares below this count as nothing.
  real(wp), parameter :: nothing = 1.0e-200_wp
  !> Components of the shear traction
  integer, parameter :: shear(2) = [along_x, along_y]
  !> Nodes of a run that are treated at a time
  integer, parameter :: most = 256

  !> Shear traction in the frames of the nodes.
  type, extends(linear_system_t) :: shear_system_t
    type(operators_t), pointer :: operators => null()
    !> Direction e of each node; t is a quarter turn ahead
    real(wp), allocatable :: direction(:, :)
    !> Compliance D along t, 0 in stick [m/Pa]
    real(wp), allocatable :: compliance(:)
    !> Where a law has a direction: traction along t of the spring at rest [Pa]
    real(wp), allocatable :: rest(:)
    !> Elastic compliance 2 lambda_1 (1 + gamma/2) l_e of a node [m/Pa]
    real(wp) :: elastic_compliance = 0.0_wp
    !> Nodes in contact
    type(active_set_t), private :: nodes
    !> Components along x and y of what is multiplied, zero off the contact; kept between the products of a solution
    real(wp), allocatable, private :: from(:)
  contains
    procedure :: product => shear_product
    procedure :: precondition => shear_precondition
    procedure :: product_packed => shear_product_packed
    procedure :: precondition_packed => shear_precondition_packed
    procedure :: release => release_shear
    !> Components along x and y from those in the frames, and back; either in place
    procedure :: to_plane, to_frame, turn
    !> Set the nodes in contact, with their frames and compliances
    procedure :: set_contact
    !> Add what springs at rest are stretched by
    procedure :: add_rest
    !> Reduce the traction of slipping nodes by their compliance
    procedure :: apply_slip_compliance
    !> Put displacements into the frames and add the stretch of the springs; take it off
    procedure :: add_springs, add_springs_packed, subtract_springs
    !> Components along x and y from packed ones in the frames
    procedure :: put_in_plane
    !> Rounding error of this subtraction
    procedure :: spring_rounding
  end type shear_system_t

contains

  !> Set up a shear system in which every node sticks.
  subroutine new_shear_system(self, operators)
    !> System to be set up
    type(shear_system_t), intent(out) :: self
    !> Operator and preconditioners
    type(operators_t), intent(inout), target :: operators
    integer :: n, i

    n = operators%flexibility%lattice%size()
    self%operators => operators
    self%space = operators%space
    self%elastic_compliance = node_compliance(operators%flexibility%lattice, operators%flexibility%pair)
    allocate (self%direction(2, n), self%compliance(n))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      self%direction(:, i) = [1.0_wp, 0.0_wp]
      self%compliance(i) = 0.0_wp
    end do
    !$omp end parallel do
    call new_active_set(self%nodes, spread(.true., 1, n), self%space)
  end subroutine new_shear_system

  !> Set the nodes in contact; their directions and compliances are known.
  subroutine set_contact(self, contact)
    class(shear_system_t), intent(inout), target :: self
    !> Nodes in contact (n)
    logical, intent(in), contiguous :: contact(:)

    if (.not. self%nodes%is_set(contact)) then
      call new_active_set(self%nodes, contact, self%space)
      call self%release()
    end if
    call self%operators%tangential%set_active(contact, self%compliance, self%direction)
  end subroutine set_contact

  !> Reduce tractions by springs in series with the stiffness that a node was found to have in stick.
  subroutine apply_slip_compliance(self, runs, along_t, along_e, plane, traction_t, traction_e)
    class(shear_system_t), intent(in) :: self
    !> Nodes in contact, and which of them have a component along e
    type(paired_runs_t), intent(in) :: runs
    !> Displacement along t and e at these nodes
    real(wp), intent(in), contiguous :: along_t(:), along_e(:)
    !> Its traction if all nodes stuck, along x and y (2 n)
    real(sp), intent(in), contiguous :: plane(:)
    !> The traction along t and e at these nodes
    real(wp), intent(inout), contiguous :: traction_t(:), traction_e(:)
    real(wp), dimension(most) :: q_t, q_e, u_e
    integer :: i, k, n, from, to, m, at

    n = size(self%compliance)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, from, to, m, at, q_t, q_e, u_e)
    do k = 1, size(runs%first)
      do from = runs%first(k), runs%last(k), most
        to = min(from + most - 1, runs%last(k))
        m = to - from + 1
        at = runs%place(k) + from - runs%first(k)
        do i = 1, m
          associate (e => self%direction(:, from + i - 1), q_x => plane(from + i - 1), q_y => plane(n + from + i - 1))
            q_t(i) = -e(2)*q_x + e(1)*q_y
            q_e(i) = e(1)*q_x + e(2)*q_y
          end associate
        end do
        ! a slipping node does not move along e
        u_e(:m) = 0.0_wp
        if (runs%second(k) > 0) u_e(:m) = along_e(runs%second(k) + from - runs%first(k):runs%second(k) + to - runs%first(k))
        call slip_compliance_row(m, self%compliance(from:to), along_t(at:at + m - 1), u_e, q_t, q_e)
        traction_t(at:at + m - 1) = q_t(:m)
        if (runs%second(k) > 0) traction_e(runs%second(k) + from - runs%first(k):runs%second(k) + to - runs%first(k)) = q_e(:m)
      end do
    end do
    !$omp end parallel do
  end subroutine apply_slip_compliance

  !> Add the stretch of the springs to displacements along x and y, in the frames.
  subroutine add_springs(self, traction, displacement)
    class(shear_system_t), intent(in) :: self
    !> Traction in the frames (2 n)
    real(wp), intent(in), contiguous :: traction(:)
    !> Components along x and y; then in the frames (2 n)
    real(wp), intent(inout), contiguous :: displacement(:)
    real(wp) :: u(2)
    integer :: n, i

    n = size(self%compliance)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(u)
    do i = 1, n
      u = [displacement(i), displacement(n + i)]
      displacement(i) = -self%direction(2, i)*u(1) + self%direction(1, i)*u(2) + self%compliance(i)*traction(i)
      displacement(n + i) = self%direction(1, i)*u(1) + self%direction(2, i)*u(2)
    end do
    !$omp end parallel do
  end subroutine add_springs

  !> Add to given displacements D tau_0, where the law of a node demands t.ds + D (tau - tau_0) = 0.
  subroutine add_rest(self, displacement)
    class(shear_system_t), intent(in) :: self
    !> In the frames (2 n)
    real(wp), intent(inout) :: displacement(:)
    integer :: i

    if (.not. allocated(self%rest)) return
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, size(self%rest)
      displacement(i) = displacement(i) + self%compliance(i)*self%rest(i)
    end do
    !$omp end parallel do
  end subroutine add_rest

  !> Subtract the stretch of their springs from the displacements of the nodes.
  subroutine subtract_springs(self, traction, displacement)
    class(shear_system_t), intent(in) :: self
    !> Traction, and displacement with the springs, in the frames (2 n)
    real(wp), intent(in) :: traction(:)
    real(wp), intent(inout) :: displacement(:)
    integer :: i

    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, size(self%compliance)
      displacement(i) = displacement(i) - self%compliance(i)*traction(i)
    end do
    !$omp end parallel do
  end subroutine subtract_springs

  !> Compute the rounding error of displacements that springs were taken off [m]: very soft ones stretch by so much that the
  !> displacements of the nodes are lost in it.
  pure real(wp) function spring_rounding(self, traction)
    class(shear_system_t), intent(in) :: self
    !> Traction in the frames (2 n)
    real(wp), intent(in) :: traction(:)
    integer :: i

    spring_rounding = 0.0_wp
    do i = 1, size(self%compliance)
      spring_rounding = max(spring_rounding, epsilon(1.0_wp)*abs(self%compliance(i)*traction(i)))
    end do
  end function spring_rounding

  !> Compute the components along x and y from those along t and e.
  subroutine to_plane(self, frame, plane)
    class(shear_system_t), intent(in) :: self
    !> Components along t and e (2 n)
    real(wp), intent(in) :: frame(:)
    !> Components along x and y (2 n)
    real(wp), intent(out) :: plane(:)
    integer :: i, n

    n = size(frame)/2
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      plane(i) = -self%direction(2, i)*frame(i) + self%direction(1, i)*frame(n + i)
      plane(n + i) = self%direction(1, i)*frame(i) + self%direction(2, i)*frame(n + i)
    end do
    !$omp end parallel do
  end subroutine to_plane

  !> Compute the components along t and e from those along x and y.
  subroutine to_frame(self, plane, frame)
    class(shear_system_t), intent(in) :: self
    !> Components along x and y (2 n)
    real(wp), intent(in) :: plane(:)
    !> Components along t and e (2 n)
    real(wp), intent(out) :: frame(:)
    integer :: i, n

    n = size(plane)/2
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      frame(i) = -self%direction(2, i)*plane(i) + self%direction(1, i)*plane(n + i)
      frame(n + i) = self%direction(1, i)*plane(i) + self%direction(2, i)*plane(n + i)
    end do
    !$omp end parallel do
  end subroutine to_frame

  !> Turn components along x and y to those along t and e, or back: a reflection, which is its own inverse.
  subroutine turn(self, values)
    class(shear_system_t), intent(in) :: self
    !> The components (2 n)
    real(wp), intent(inout), contiguous :: values(:)
    real(wp) :: v(2)
    integer :: i, n

    n = size(values)/2
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(v)
    do i = 1, n
      v = [values(i), values(n + i)]
      values(i) = -self%direction(2, i)*v(1) + self%direction(1, i)*v(2)
      values(n + i) = self%direction(1, i)*v(1) + self%direction(2, i)*v(2)
    end do
    !$omp end parallel do
  end subroutine turn

  !> Multiply by the tangential flexibility with the springs of slipping nodes, in their frames.
  subroutine shear_product(self, x, y, error)
    class(shear_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: n, k, i

    n = size(self%compliance)
    call take_from(self)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i)
    do k = 1, size(self%nodes%first)
      do i = self%nodes%first(k), self%nodes%last(k)
        self%from(i) = -self%direction(2, i)*x(i) + self%direction(1, i)*x(n + i)
        self%from(n + i) = self%direction(1, i)*x(i) + self%direction(2, i)*x(n + i)
      end do
    end do
    !$omp end parallel do
    call self%operators%apply(shear, self%from, shear, y, error)
    if (allocated(error)) return
    call self%add_springs(x, y)
    call self%release()
  end subroutine shear_product

  !> Take memory for what is multiplied, zero.
  subroutine take_from(self)
    class(shear_system_t), intent(inout) :: self

    if (allocated(self%from)) return
    allocate (self%from(2*size(self%compliance)))
    call self%space%fill(self%from, 0.0_wp)
  end subroutine take_from

  !> Free it.
  subroutine release_shear(self)
    class(shear_system_t), intent(inout) :: self

    if (allocated(self%from)) deallocate (self%from)
  end subroutine release_shear

  !> Multiply values at the active nodes: the component along t of all nodes in contact, that along e of some.
  subroutine shear_product_packed(self, nodes, x, y, error)
    class(shear_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    type(active_set_t) :: along_t
    type(paired_runs_t) :: runs

    call take_from(self)
    along_t = nodes%slice(1, size(y)/2)
    call pair_runs(along_t, nodes%slice(size(y)/2 + 1, size(y)), runs)
    associate (n_t => along_t%n_active)
      call self%put_in_plane(runs, x(:n_t), x(n_t + 1:), self%from)
      call self%operators%apply(shear, self%from, shear, y, error)
      if (allocated(error)) return
      call self%add_springs_packed(runs, x(:n_t), y)
    end associate
  end subroutine shear_product_packed

  !> Compute the components along x and y at the nodes in contact from those along t and e; values elsewhere stay.
  subroutine put_in_plane(self, runs, along_t, along_e, plane)
    class(shear_system_t), intent(in) :: self
    !> Nodes in contact, and which of them have a component along e
    type(paired_runs_t), intent(in) :: runs
    !> Components along t and e
    real(wp), intent(in), contiguous :: along_t(:), along_e(:)
    !> Components along x and y (2 n)
    real(wp), intent(inout), contiguous :: plane(:)
    real(wp) :: t, e
    integer :: n, k, i

    n = size(plane)/2
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, t, e)
    do k = 1, size(runs%first)
      if (runs%second(k) == 0) then
        do i = runs%first(k), runs%last(k)
          t = along_t(runs%place(k) + i - runs%first(k))
          plane(i) = -self%direction(2, i)*t
          plane(n + i) = self%direction(1, i)*t
        end do
      else
        do i = runs%first(k), runs%last(k)
          t = along_t(runs%place(k) + i - runs%first(k))
          e = along_e(runs%second(k) + i - runs%first(k))
          plane(i) = -self%direction(2, i)*t + self%direction(1, i)*e
          plane(n + i) = self%direction(1, i)*t + self%direction(2, i)*e
        end do
      end if
    end do
    !$omp end parallel do
  end subroutine put_in_plane

  !> Put displacements along x and y into the frames, and add the stretch of the springs.
  subroutine add_springs_packed(self, runs, along_t, displacement)
    class(shear_system_t), intent(in) :: self
    !> Nodes in contact
    type(paired_runs_t), intent(in) :: runs
    !> Traction along t at these nodes
    real(wp), intent(in), contiguous :: along_t(:)
    !> Components along x and y; then in the frames (2 n)
    real(wp), intent(inout), contiguous :: displacement(:)
    real(wp) :: u(2)
    integer :: n, k, i

    n = size(self%compliance)
    !$omp parallel num_threads(self%space%threads) private(i, u)
    !$omp do schedule(static)
    do i = 1, n
      u = [displacement(i), displacement(n + i)]
      displacement(i) = -self%direction(2, i)*u(1) + self%direction(1, i)*u(2)
      displacement(n + i) = self%direction(1, i)*u(1) + self%direction(2, i)*u(2)
    end do
    !$omp end do
    !$omp do schedule(static)
    do k = 1, size(runs%first)
      do i = runs%first(k), runs%last(k)
        displacement(i) = displacement(i) + self%compliance(i)*along_t(runs%place(k) + i - runs%first(k))
      end do
    end do
    !$omp end do
    !$omp end parallel
  end subroutine add_springs_packed

  !> Apply the preconditioner of the shear traction.
  subroutine shear_precondition(self, x, y, error)
    class(shear_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    associate (operators => self%operators, error => error)
      call operators%tangential%apply(x, y, operators%preconditioning)
    end associate
  end subroutine shear_precondition

  !> Apply it to the values at the active nodes.
  subroutine shear_precondition_packed(self, nodes, n, r, z, error)
    class(shear_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)
    type(error_t), allocatable, intent(out) :: error

    associate (operators => self%operators, error => error)
      call operators%tangential%apply_packed(nodes, n, r, z, operators%preconditioning)
    end associate
  end subroutine shear_precondition_packed

  !> Reduce the tractions of a row by springs in series with the stiffness that each node was found to have in stick.
  pure subroutine slip_compliance_row(n, compliance, ux, uy, qx, qy)
    !> Number of nodes
    integer, intent(in) :: n
    !> Compliance of the springs, and displacements
    real(wp), intent(in) :: compliance(n), ux(n), uy(n)
    !> Tractions if all nodes stuck, and what is left of them
    real(wp), intent(inout) :: qx(n), qy(n)
    real(wp) :: moved, stretch, left
    integer :: i

    !$omp simd private(moved, stretch, left)
    do i = 1, n
      ! what the spring gives way under that traction
      stretch = compliance(i)*sqrt(qx(i)**2 + qy(i)**2)
      moved = sqrt(ux(i)**2 + uy(i)**2)
      left = merge(moved/max(moved + stretch, nothing), 1.0_wp, stretch > 0.0_wp)
      qx(i) = left*qx(i)
      qy(i) = left*qy(i)
    end do
  end subroutine slip_compliance_row

end module hc_shear_system
