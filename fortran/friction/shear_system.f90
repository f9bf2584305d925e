!> The linear problem of the shear traction on the nodes in contact, for conjugate gradients ((F10) of
!> docs/theory/friction.md).
!>
!> Every node in contact has a frame (t, e); a sticking node carries both components of q, a slipping one tau in
!> q = mu p e + tau t and the compliance D along t. The matrix
!>
!>     R^T T R + D,     R: frame -> (x, y)
!>
!> is symmetric positive definite on these unknowns. Its preconditioner is the inverse symbol in stick, and goes
!> over to 1/D where a node slips far (see symbol_preconditioner).
!>
!> A field with two components is one vector, first the one, then the other.
module hc_shear_system
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_flexibility, only: along_x, along_y
  use hc_symbol_preconditioner, only: node_compliance, blend
  use hc_preconditioner_extension, only: edge_extension_t, new_edge_extension
  use hc_elastic_operators, only: operators_t
  use hc_linear_system, only: linear_system_t
  use hc_active_set, only: active_set_t, new_active_set
  implicit none
  private

  public :: shear_system_t, new_shear_system, soften_row

  !> Squares below this count as nothing.
  real(wp), parameter :: nothing = 1.0e-200_wp
  !> Components of the shear traction
  integer, parameter :: shear(2) = [along_x, along_y]
  !> Nodes that one thread takes at a time
  integer, parameter :: row_block = 4096

  !> Shear traction in the frames of the nodes.
  type, extends(linear_system_t) :: shear_system_t
    type(operators_t), pointer :: operators => null()
    !> Direction e of each node; t is a quarter turn ahead
    real(wp), allocatable :: direction(:, :)
    !> Compliance D along t, 0 in stick [m/Pa]
    real(wp), allocatable :: compliance(:)
    !> Weights of each node in the preconditioners without and with soft springs; does anyone need them?
    real(wp), allocatable :: weight(:, :)
    logical, private :: used(2) = .true.
    !> Elastic compliance 2 lambda_1 (1 + gamma/2) l_e of a node [m/Pa]
    real(wp) :: elastic_compliance = 0.0_wp
    !> Continuation of displacements beyond the contact
    type(edge_extension_t), private :: edge
    !> Nodes in contact
    logical, allocatable, private :: contact(:)
    type(active_set_t), private :: nodes
    !> Components along x and y of what is multiplied (zero off the contact) or preconditioned, and what comes of it
    real(wp), allocatable, private :: from(:), onto(:)
    real(sp), allocatable, private :: displacement(:), traction(:)
  contains
    procedure :: product => shear_product
    procedure :: precondition => shear_precondition
    !> Components along x and y from those in the frames, and back
    procedure :: to_plane, to_frame
    !> Take the nodes in contact; work the weights out from the compliances
    procedure :: weigh
    !> Let the traction of a slipping node be the smaller the softer it is
    procedure :: soften
    !> Take the stretch of the springs off displacements
    procedure :: take_springs_off
  end type shear_system_t

contains

  !> A shear system in which every node sticks.
  subroutine new_shear_system(self, operators)
    !> System to be set up
    type(shear_system_t), intent(out) :: self
    !> Operator and preconditioners
    type(operators_t), intent(inout), target :: operators
    integer :: n, i
    logical :: all_nodes(operators%flexibility%lattice%size())

    n = operators%flexibility%lattice%size()
    self%operators => operators
    self%space = operators%space
    self%elastic_compliance = node_compliance(operators%flexibility%lattice, operators%flexibility%pair)
    allocate (self%direction(2, n), self%compliance(n), self%weight(n, 2), self%from(2*n), self%onto(2*n), &
              self%displacement(2*n), self%traction(2*n))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      self%direction(:, i) = [1.0_wp, 0.0_wp]
      self%compliance(i) = 0.0_wp
      self%weight(i, :) = [1.0_wp, 0.0_wp]
      self%from([i, n + i]) = 0.0_wp
      self%displacement([i, n + i]) = 0.0_sp
      all_nodes(i) = .true.
    end do
    !$omp end parallel do
    call new_active_set(self%nodes, all_nodes, self%space)
  end subroutine new_shear_system

  !> Take the nodes in contact; weigh the preconditioners by the compliances.
  subroutine weigh(self, contact)
    class(shear_system_t), intent(inout) :: self
    !> Nodes in contact (n)
    logical, intent(in) :: contact(:)
    integer :: i
    logical :: known, used(2)

    known = allocated(self%contact)
    if (known) known = count(self%contact .neqv. contact) == 0
    if (.not. known) then
      self%contact = contact
      call new_edge_extension(self%edge, reshape(contact, self%operators%flexibility%lattice%extent), self%space)
      call new_active_set(self%nodes, contact, self%space)
      call self%space%fill(self%from, 0.0_wp)
    end if
    used = .false.
    !$omp parallel do schedule(static) num_threads(self%space%threads) reduction(.or.: used)
    do i = 1, size(contact)
      self%weight(i, :) = blend(self%compliance(i)/self%elastic_compliance)
      if (contact(i)) used = used .or. self%weight(i, :) > 0.0_wp
    end do
    !$omp end parallel do
    self%used = used
  end subroutine weigh

  !> A spring in series with the stiffness that a node was found to have in stick: what it leaves of the traction.
  subroutine soften(self, displacement, plane, active, traction)
    class(shear_system_t), intent(in) :: self
    !> Displacement, in the frames (2 n)
    real(wp), intent(in), contiguous :: displacement(:)
    !> Its traction if all nodes stuck, along x and y (2 n)
    real(wp), intent(in), contiguous :: plane(:)
    !> Components that are wanted (2 n)
    logical, intent(in), contiguous :: active(:)
    !> The traction, in the frames; zero where it is not wanted (2 n)
    real(wp), intent(out), contiguous :: traction(:)
    integer :: i, n, from, to

    n = size(self%compliance)
    call self%to_frame(plane, traction)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, to)
    do from = 1, n, row_block
      to = min(from + row_block - 1, n)
      call soften_row(to - from + 1, self%compliance(from:to), displacement(from:to), displacement(n + from:n + to), &
                      traction(from:to), traction(n + from:n + to))
      do i = from, to
        if (.not. active(i)) traction(i) = 0.0_wp
        if (.not. active(n + i)) traction(n + i) = 0.0_wp
      end do
    end do
    !$omp end parallel do
  end subroutine soften

  !> Displacements of the nodes themselves, without the stretch of their springs.
  subroutine take_springs_off(self, traction, displacement)
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
  end subroutine take_springs_off

  !> Components along x and y from those along t and e.
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

  !> Components along t and e from those along x and y.
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

  subroutine shear_product(self, x, y, error)
    class(shear_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: n, k, i

    n = size(x)/2
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i)
    do k = 1, size(self%nodes%first)
      do i = self%nodes%first(k), self%nodes%last(k)
        self%from(i) = -self%direction(2, i)*x(i) + self%direction(1, i)*x(n + i)
        self%from(n + i) = self%direction(1, i)*x(i) + self%direction(2, i)*x(n + i)
      end do
    end do
    !$omp end parallel do
    call self%operators%apply(shear, self%from, shear, self%onto, error)
    if (allocated(error)) return
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      y(i) = -self%direction(2, i)*self%onto(i) + self%direction(1, i)*self%onto(n + i) + self%compliance(i)*x(i)
      y(n + i) = self%direction(1, i)*self%onto(i) + self%direction(2, i)*self%onto(n + i)
    end do
    !$omp end parallel do
  end subroutine shear_product

  subroutine shear_precondition(self, x, y, error)
    class(shear_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: t, e, unit, loose
    integer :: n, k, i, m

    n = size(x)/2
    unit = self%operators%tangential%unit
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, loose)
    do k = 1, size(self%nodes%first)
      do i = self%nodes%first(k), self%nodes%last(k)
        loose = 1.0_wp - sum(self%weight(i, :)**2)
        y(i) = 0.0_wp
        if (self%compliance(i) > 0.0_wp) y(i) = loose/self%compliance(i)*x(i)
        y(n + i) = 0.0_wp
      end do
    end do
    !$omp end parallel do
    do m = 1, size(self%used)
      if (.not. self%used(m)) cycle
      ! the continuation beyond the contact is made afresh
      !$omp parallel num_threads(self%space%threads) private(i, t, e)
      !$omp do schedule(static)
      do i = 1, size(self%displacement)
        self%displacement(i) = 0.0_sp
      end do
      !$omp end do
      !$omp do schedule(static)
      do k = 1, size(self%nodes%first)
        do i = self%nodes%first(k), self%nodes%last(k)
          t = self%weight(i, m)/unit*x(i)
          e = self%weight(i, m)/unit*x(n + i)
          self%displacement(i) = real(-self%direction(2, i)*t + self%direction(1, i)*e, sp)
          self%displacement(n + i) = real(self%direction(1, i)*t + self%direction(2, i)*e, sp)
        end do
      end do
      !$omp end do
      !$omp end parallel
      call self%operators%precondition_shear(self%edge, m == 2, self%displacement, self%traction)
      !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, t, e)
      do k = 1, size(self%nodes%first)
        do i = self%nodes%first(k), self%nodes%last(k)
          t = -self%direction(2, i)*self%traction(i) + self%direction(1, i)*self%traction(n + i)
          e = self%direction(1, i)*self%traction(i) + self%direction(2, i)*self%traction(n + i)
          y(i) = y(i) + self%weight(i, m)*t
          y(n + i) = y(n + i) + self%weight(i, m)*e
        end do
      end do
      !$omp end parallel do
    end do
  end subroutine shear_precondition

  !> A spring in series with the stiffness that each node was found to have in stick: what it leaves of the traction.
  pure subroutine soften_row(n, compliance, ux, uy, qx, qy)
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
  end subroutine soften_row

end module hc_shear_system
