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
  use hc_precision, only: wp, lk
  use hc_error, only: error_t
  use hc_flexibility, only: along_x, along_y
  use hc_inverse_symbol, only: node_compliance
  use hc_operator_set, only: operators_t, traction_system_t
  use hc_frame_rows, only: turn_row, add_springs_row, take_off_row, slip_compliance_row
  use hc_active_set, only: active_set_t, new_active_set, paired_runs_t
  implicit none
  private

  public :: shear_system_t, new_shear_system

  !> Components of the shear traction
  integer, parameter :: shear(2) = [along_x, along_y]
  !> Nodes of a run that are treated at a time
  integer, parameter :: most = 256

  !> Shear traction in the frames of the nodes.
  type, extends(traction_system_t) :: shear_system_t
    !> Nodes in contact, in runs along the rows
    type(active_set_t) :: nodes
    !> Direction e of each of them; t is a quarter turn ahead
    real(wp), allocatable :: direction(:, :)
    !> Compliance D along t, 0 in stick [m/Pa]
    real(wp), allocatable :: compliance(:)
    !> Where a law has a direction: traction along t of the spring at rest [Pa]
    real(wp), allocatable :: rest(:)
    !> Elastic compliance of a node [m/Pa]
    real(wp) :: elastic_compliance = 0.0_wp
  contains
    procedure :: product => shear_product
    procedure :: product_packed => shear_product_packed
    procedure :: precondition_packed => shear_precondition_packed
    !> Turn components along x and y into the frames, or back
    procedure :: turn
    !> Set the nodes in contact, all of which stick; prepare for their frames and compliances
    procedure :: set_contact, use_frames
    !> Add the stretch of springs at rest
    procedure :: add_rest
    !> Reduce the traction of slipping nodes by their compliance
    procedure :: apply_slip_compliance
    !> Turn displacements into the frames and add the stretch of the springs
    procedure :: add_springs
    !> Take it off, and turn tractions and displacements out of the frames
    procedure :: leave_frames
    !> Displacements by tractions in the frames
    procedure :: displace
  end type shear_system_t

contains

  !> Set up a shear system without contact.
  subroutine new_shear_system(self, operators)
    !> System to be set up
    type(shear_system_t), intent(out) :: self
    !> Operator and preconditioners
    type(operators_t), intent(inout), target :: operators

    self%operators => operators
    self%space = operators%space
    self%symmetric = .not. operators%rolling%steady
    self%elastic_compliance = node_compliance(operators%flexibility%lattice, operators%flexibility%medium)
  end subroutine new_shear_system

  !> Set the nodes in contact: they stick, in frames along x and y.
  subroutine set_contact(self, contact)
    class(shear_system_t), intent(inout) :: self
    !> Nodes in contact (n)
    logical(lk), intent(in), contiguous :: contact(:)
    integer :: i

    if (allocated(self%compliance)) then
      if (.not. self%nodes%is_set(contact)) deallocate (self%direction, self%compliance)
    end if
    if (.not. allocated(self%compliance)) then
      call new_active_set(self%nodes, contact, self%space, self%space%own_extent(self%operators%flexibility%lattice%extent))
      allocate (self%direction(2, self%nodes%n_active), self%compliance(self%nodes%n_active))
    end if
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, size(self%compliance)
      self%direction(:, i) = [1.0_wp, 0.0_wp]
      self%compliance(i) = 0.0_wp
    end do
    !$omp end parallel do
  end subroutine set_contact

  !> Prepare the preconditioner for the frames and compliances of the nodes in contact.
  subroutine use_frames(self, contact)
    class(shear_system_t), intent(inout), target :: self
    !> Nodes in contact (n)
    logical(lk), intent(in), contiguous :: contact(:)

    call self%operators%tangential%set_active(contact, self%compliance, self%direction)
  end subroutine use_frames

  !> Turn tractions into the frames, and reduce them by springs in series with the stiffness that a node was found to have in stick.
  subroutine apply_slip_compliance(self, runs, along_t, along_e, traction)
    class(shear_system_t), intent(in) :: self
    !> Nodes in contact, and which of them have a component along e
    type(paired_runs_t), intent(in) :: runs
    !> Displacement along t and e at these nodes
    real(wp), intent(in), contiguous :: along_t(:), along_e(:)
    !> Its traction if all nodes stuck, along x and y; then that along t and e (2 n)
    real(wp), intent(inout), contiguous :: traction(:)
    real(wp) :: u_e(most)
    integer :: k, n, from, to, m, at

    n = size(traction)/2
    call self%turn(traction)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(from, to, m, at, u_e)
    do k = 1, size(runs%first)
      do from = runs%first(k), runs%last(k), most
        to = min(from + most - 1, runs%last(k))
        m = to - from + 1
        at = runs%place(k) + from - runs%first(k)
        ! a slipping node does not move along e
        u_e(:m) = 0.0_wp
        if (runs%second(k) > 0) u_e(:m) = along_e(runs%second(k) + from - runs%first(k):runs%second(k) + to - runs%first(k))
        call slip_compliance_row(m, self%compliance(at:at + m - 1), along_t(at:at + m - 1), u_e, traction(from:to), &
                                 traction(n + from:n + to))
      end do
    end do
    !$omp end parallel do
  end subroutine apply_slip_compliance

  !> Turn displacements along x and y into the frames of the nodes in contact, and add the stretch of the springs.
  subroutine add_springs(self, traction, displacement)
    class(shear_system_t), intent(in) :: self
    !> Traction in the frames (2 n), or that along t of these nodes alone
    real(wp), intent(in), contiguous :: traction(:)
    !> Components along x and y; then in the frames (2 n)
    real(wp), intent(inout), contiguous :: displacement(:)
    integer :: n, k, from, to, at, first
    logical :: packed

    n = size(displacement)/2
    packed = size(traction) < size(displacement)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(from, to, at, first)
    do k = 1, size(self%nodes%first)
      from = self%nodes%first(k)
      to = self%nodes%last(k)
      at = self%nodes%place(k)
      first = merge(at, from, packed)
      call add_springs_row(to - from + 1, self%direction(:, at:at + to - from), self%compliance(at:at + to - from), &
                           traction(first:first + to - from), displacement(from:to), displacement(n + from:n + to))
    end do
    !$omp end parallel do
  end subroutine add_springs

  !> Add to given displacements D tau_0, where the law of a node demands t.ds + D (tau - tau_0) = 0.
  subroutine add_rest(self, displacement)
    class(shear_system_t), intent(in) :: self
    !> In the frames (2 n)
    real(wp), intent(inout) :: displacement(:)
    integer :: k, i, at

    if (.not. allocated(self%rest)) return
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, at)
    do k = 1, size(self%nodes%first)
      do i = self%nodes%first(k), self%nodes%last(k)
        at = self%nodes%place(k) + i - self%nodes%first(k)
        displacement(i) = displacement(i) + self%compliance(at)*self%rest(at)
      end do
    end do
    !$omp end parallel do
  end subroutine add_rest

  !> Take the stretch of the springs off the displacements of the nodes in contact, and turn tractions and displacements out
  !> of the frames.
  subroutine leave_frames(self, traction, displacement, rounding)
    class(shear_system_t), intent(in) :: self
    !> Traction, and displacement with the springs, in the frames; then along x and y (2 n)
    real(wp), intent(inout), contiguous :: traction(:), displacement(:)
    !> Rounding error of the displacements [m]: very soft springs stretch by so much that the displacements of the nodes are
    !> lost in it
    real(wp), intent(out) :: rounding
    integer :: k, from, to, at

    rounding = 0.0_wp
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(from, to, at) reduction(max: rounding)
    do k = 1, size(self%nodes%first)
      from = self%nodes%first(k)
      to = self%nodes%last(k)
      at = self%nodes%place(k)
      call take_off_row(to - from + 1, self%compliance(at:at + to - from), traction(from:to), displacement(from:to), rounding)
    end do
    !$omp end parallel do
    call self%turn(traction)
    call self%turn(displacement)
    rounding = epsilon(1.0_wp)*self%space%largest(rounding)
  end subroutine leave_frames

  !> Turn components along x and y to those along t and e, or back, at the nodes in contact: a reflection, which is its own
  !> inverse.
  subroutine turn(self, values)
    class(shear_system_t), intent(in) :: self
    !> The components (2 n)
    real(wp), intent(inout), contiguous :: values(:)
    integer :: n, k, from, to, at

    n = size(values)/2
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(from, to, at)
    do k = 1, size(self%nodes%first)
      from = self%nodes%first(k)
      to = self%nodes%last(k)
      at = self%nodes%place(k)
      call turn_row(to - from + 1, self%direction(:, at:at + to - from), values(from:to), values(n + from:n + to))
    end do
    !$omp end parallel do
  end subroutine turn

  !> Multiply by the tangential flexibility with the springs of slipping nodes, in their frames.
  subroutine shear_product(self, x, y, error)
    class(shear_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    call self%space%copy(x, y)
    call self%displace(x, y, error)
  end subroutine shear_product

  !> Multiply values at the active nodes: the component along t of all nodes in contact, that along e of some.
  subroutine shear_product_packed(self, nodes, x, y, error)
    class(shear_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    call self%space%fill(y, 0.0_wp)
    call nodes%unpack(x, y)
    call self%displace(x(:nodes%pairs%n_first), y, error)
  end subroutine shear_product_packed

  !> Compute the displacements by tractions in the frames, in their place, with the stretch of the springs.
  subroutine displace(self, traction, values, error)
    class(shear_system_t), intent(inout) :: self
    !> The tractions (2 n), or those along t of the nodes in contact alone
    real(wp), intent(in), contiguous :: traction(:)
    !> The tractions, then the displacements (2 n)
    real(wp), intent(inout), contiguous, target :: values(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    call self%turn(values)
    call self%operators%replace(shear, values, error)
    if (allocated(error)) return
    call self%add_springs(traction, values)
  end subroutine displace

  !> Apply the preconditioner of the shear traction.
  subroutine shear_precondition_packed(self, nodes, n, r, z)
    class(shear_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)

    associate (operators => self%operators)
      call operators%tangential%apply_packed(nodes, n, r, z, operators%preconditioning)
      if (operators%rolling%steady) call sum_behind(self, nodes, z)
    end associate
  end subroutine shear_precondition_packed

  !> Sum the differences between the tractions of nodes and of those ahead along the rows.
  !>
  !> With the shift Z to the node ahead B = T (1 - Z) = (1 - Z) T but for the rear of the contact, and (1 - Z)^-1 sums from its
  !> front on. Slipping nodes, whose traction is known but for the component across, begin a new sum.
  subroutine sum_behind(self, nodes, z)
    class(shear_system_t), intent(in) :: self
    !> Unknowns of these nodes, in pairs
    type(active_set_t), intent(in) :: nodes
    !> Traction along t and e at these nodes
    real(wp), intent(inout), contiguous :: z(:)
    real(wp), allocatable :: plane(:)
    real(wp) :: own
    integer :: n, k, i, m, at, to_ahead
    logical :: forward

    n = product(self%space%own_extent(self%operators%flexibility%lattice%extent))
    allocate (plane(2*n), source=0.0_wp)
    call nodes%unpack(z, plane)
    call self%turn(plane)
    associate (runs => nodes%pairs, rolling => self%operators%rolling)
      to_ahead = rolling%stride(self%operators%flexibility%lattice%extent(1))
      forward = to_ahead > 0
      do k = merge(size(runs%first), 1, forward), merge(1, size(runs%first), forward), merge(-1, 1, forward)
        do i = merge(runs%last(k), runs%first(k), forward), merge(runs%first(k), runs%last(k), forward), merge(-1, 1, forward)
          at = runs%place(k) + i - runs%first(k)
          own = self%elastic_compliance/(self%elastic_compliance + self%compliance(at))
          do m = 0, n, n
            plane(m + i) = plane(m + i)/rolling%share
            if (i + to_ahead >= 1 .and. i + to_ahead <= n) plane(m + i) = plane(m + i) + own*plane(m + i + to_ahead)
          end do
        end do
      end do
    end associate
    call self%turn(plane)
    call nodes%pack(plane, z)
  end subroutine sum_behind

end module hc_shear_system
