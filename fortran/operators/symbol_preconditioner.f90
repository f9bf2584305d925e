!> The preconditioners of pressure and shear traction: the inverse symbol on the nodes in contact.
!>
!> Displacements are continued beyond the edge of the contact (preconditioner_extension) and multiplied by the inverse
!> symbol (inverse_symbol); the tractions beyond the edge are added to those inside by the transpose of the continuation.
!>
!> For shear tractions there is a second inverse symbol, of a body whose every node has a soft spring: which one suits a
!> slipping node depends on the compliance D of its spring.
!> The elastic compliance of a traction grows with the length of its waves: from that of a
!> single node, t_h, for the shortest ones to that of the whole contact. A spring that is
!> softer than all of them leaves 1/D, one that is stiffer than all of them leaves the inverse symbol.
!> In between short waves see the spring and long ones the elastic body: there the
!> inverse symbol is taken of the body on springs of one compliance. The three go over into each other with log D,
!>
!>     M = sqrt(chi_1) T^-1 sqrt(chi_1) + sqrt(chi_2) (T + D_soft)^-1 sqrt(chi_2) + chi_3/D,     sum of chi = 1.
!>
!> Equations: docs/theory/preconditioner.md, (P2) to (P6).
module hc_symbol_preconditioner
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_active_set, only: active_set_t, new_active_set, paired_runs_t
  use hc_frame_rows, only: slip_to_plane, stick_to_plane, add_turned
  use hc_inverse_symbol, only: inverse_symbol_t, new_inverse_symbol, node_compliance
  use hc_preconditioner, only: preconditioner_t
  use hc_preconditioner_extension, only: edge_extension_t, new_edge_extension
  implicit none
  private

  public :: pressure_preconditioner_t, shear_preconditioner_t, new_symbol_preconditioner, blend

  !> Inverse symbol with its continuation beyond the contact.
  type, extends(preconditioner_t), abstract :: symbol_preconditioner_t
    private
    type(inverse_symbol_t) :: inverse
    type(preconditioner_options_t) :: options
    !> Columns and rows of the window
    integer :: extent(2) = 0
    !> Space of the fields
    type(field_space_t) :: space
    !> Continuation of displacements beyond the contact; none before there are active nodes
    type(edge_extension_t), allocatable :: edge
    !> Displacements, zero off the contact but for the rings of `edge`, and tractions in single precision; kept between the
    !> applications of a solution
    real(sp), allocatable :: given(:), wanted(:)
  contains
    procedure :: release
  end type symbol_preconditioner_t

  !> Approximate inverse of the normal flexibility.
  type, extends(symbol_preconditioner_t) :: pressure_preconditioner_t
  contains
    procedure :: set_active => set_contact
    procedure :: apply => apply_to_pressure
    procedure :: apply_single => apply_to_pressure_single
    procedure :: apply_packed => apply_to_pressure_packed
    procedure :: clear => clear_contact
  end type pressure_preconditioner_t

  !> Approximate inverse of the tangential flexibility with the springs of slipping nodes.
  type, extends(symbol_preconditioner_t) :: shear_preconditioner_t
    private
    !> Elastic compliance t_h of a node [m/Pa]
    real(wp) :: elastic_compliance = 0.0_wp
    !> Direction e
    real(wp), pointer, contiguous :: direction(:, :) => null()
    !> On the nodes in contact: weights sqrt(chi) in the inverse symbols without and with soft springs, and what is left to the
    !> springs, chi_3/D [Pa/m]; is one of the weights not zero?
    real(sp), allocatable :: weight(:, :)
    real(wp), allocatable :: left(:)
    logical :: used(2) = .true.
    !> Nodes in contact
    type(active_set_t) :: nodes
  contains
    procedure :: set_active => set_sheared
    procedure :: apply => apply_to_shear
    procedure :: apply_packed => apply_to_shear_packed
    procedure :: clear => clear_sheared
  end type shear_preconditioner_t

  !> Rounding errors of the sum of squares of weights.
  real(wp), parameter :: rounding = 8.0_wp*epsilon(1.0_sp)

contains

  !> Set up a preconditioner over a window: of the pressure or of the shear traction, by the type of `self`.
  subroutine new_symbol_preconditioner(self, lattice, pair, space, options, error, cache)
    !> Preconditioner to be set up
    class(symbol_preconditioner_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Tuning numbers
    type(preconditioner_options_t), intent(in) :: options
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(preconditioner_options_t) :: usual
    type(kernel_cache_t), pointer :: shared

    select type (self)
    type is (shear_preconditioner_t)
      shared => null()
      ! the key of a spectrum does not have the compliance of the springs
      if (present(cache) .and. abs(options%soft_spring - usual%soft_spring) <= 0.0_wp) shared => cache
      call new_inverse_symbol(self%inverse, lattice, pair, space, error, options%soft_spring, shared)
      self%elastic_compliance = node_compliance(lattice, pair)
    class default
      call new_inverse_symbol(self%inverse, lattice, pair, space, error, cache=cache)
    end select
    self%unit = self%inverse%unit
    self%extent = lattice%extent
    self%space = space
    self%options = options
  end subroutine new_symbol_preconditioner

  !> Set the nodes in contact, and their springs.
  subroutine set_contact(self, active, compliance, direction)
    class(pressure_preconditioner_t), intent(inout) :: self
    logical, intent(in), contiguous :: active(:)
    real(wp), intent(in), optional, target, contiguous :: compliance(:), direction(:, :)

    associate (direction => direction)
      if (present(compliance)) then
        call self%inverse%set_springs(self%options, compliance, active)
        ! displacements go on beyond the nodes on stiff springs
        call continue_beyond(self, self%extent, active .and. .not. self%inverse%is_loose(compliance))
      else
        call continue_beyond(self, self%extent, active)
      end if
    end associate
  end subroutine set_contact

  !> Set up the continuation beyond some nodes, which are handed on without a copy.
  subroutine continue_beyond(self, extent, active)
    class(symbol_preconditioner_t), intent(inout) :: self
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)
    !> The nodes
    logical, intent(in) :: active(extent(1), extent(2))

    call self%release()
    if (.not. allocated(self%edge)) allocate (self%edge)
    call new_edge_extension(self%edge, active, self%space, self%options)
  end subroutine continue_beyond

  !> Take memory for displacements, zero, and tractions.
  subroutine take_memory(self, n)
    class(symbol_preconditioner_t), intent(inout) :: self
    !> Number of values
    integer, intent(in) :: n
    integer :: i

    if (allocated(self%given)) return
    allocate (self%given(n), self%wanted(n))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, n
      self%given(i) = 0.0_sp
    end do
    !$omp end parallel do
  end subroutine take_memory

  !> Free it.
  subroutine release(self)
    class(symbol_preconditioner_t), intent(inout) :: self

    if (allocated(self%given)) deallocate (self%given, self%wanted)
  end subroutine release

  !> Estimate the pressure that causes a closing of the gap.
  subroutine apply_to_pressure(self, displacement, traction, work)
    class(pressure_preconditioner_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: displacement(:)
    real(wp), intent(out), contiguous, target :: traction(:)
    real(wp), intent(inout) :: work

    call self%inverse%apply(displacement, traction, self%edge)
    work = work + self%inverse%cost
  end subroutine apply_to_pressure

  !> Estimate it at the nodes in contact alone.
  subroutine apply_to_pressure_packed(self, nodes, n, displacement, traction, work)
    class(pressure_preconditioner_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: displacement(:)
    real(wp), intent(inout), contiguous :: traction(:)
    real(wp), intent(inout) :: work
    integer :: i, k, shift

    call take_memory(self, n)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(nodes%first)
      shift = nodes%place(k) - nodes%first(k)
      do i = nodes%first(k), nodes%last(k)
        self%given(i) = real(displacement(i + shift)/self%unit, sp)
      end do
    end do
    !$omp end parallel do
    call self%apply_single(self%given, self%wanted, work)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(nodes%first)
      shift = nodes%place(k) - nodes%first(k)
      do i = nodes%first(k), nodes%last(k)
        traction(i + shift) = self%wanted(i)
      end do
    end do
    !$omp end parallel do
  end subroutine apply_to_pressure_packed

  !> Estimate it in single precision.
  subroutine apply_to_pressure_single(self, displacement, traction, work)
    class(pressure_preconditioner_t), intent(inout) :: self
    real(sp), intent(inout), contiguous, target :: displacement(:)
    real(sp), intent(out), contiguous, target :: traction(:)
    real(wp), intent(inout) :: work

    call self%inverse%apply_single(displacement, traction, self%edge)
    work = work + self%inverse%cost
  end subroutine apply_to_pressure_single

  !> Forget the nodes in contact.
  subroutine clear_contact(self)
    class(pressure_preconditioner_t), intent(inout) :: self

    call self%release()
    if (allocated(self%edge)) deallocate (self%edge)
  end subroutine clear_contact

  !> Set the nodes in contact; weigh the inverse symbols by the compliances.
  subroutine set_sheared(self, active, compliance, direction)
    class(shear_preconditioner_t), intent(inout) :: self
    logical, intent(in), contiguous :: active(:)
    real(wp), intent(in), optional, target, contiguous :: compliance(:), direction(:, :)
    integer :: i, k, at
    logical :: known, used(2)
    real(wp) :: share

    self%direction => direction
    known = allocated(self%weight)
    if (known) known = self%nodes%is_set(active)
    if (.not. known) then
      call continue_beyond(self, self%extent, active)
      call new_active_set(self%nodes, active, self%space)
      if (allocated(self%weight)) deallocate (self%weight, self%left)
      allocate (self%weight(self%nodes%n_active, 2), self%left(self%nodes%n_active))
    end if
    used = .false.
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, at, share) reduction(.or.: used)
    do k = 1, size(self%nodes%first)
      do i = self%nodes%first(k), self%nodes%last(k)
        at = self%nodes%place(k) + i - self%nodes%first(k)
        if (compliance(i) > 0.0_wp) then
          self%weight(at, :) = real(blend(self%options, compliance(i)/self%elastic_compliance), sp)
          share = 1.0_wp - sum(real(self%weight(at, :), wp)**2)
          self%left(at) = merge(share/compliance(i), 0.0_wp, share > rounding)
        else
          self%weight(at, :) = [1.0_sp, 0.0_sp]
          self%left(at) = 0.0_wp
        end if
        used = used .or. self%weight(at, :) > 0.0_sp
      end do
    end do
    !$omp end parallel do
    self%used = used
  end subroutine set_sheared

  !> Estimate the shear traction, in the frames of the nodes, that causes a displacement there.
  subroutine apply_to_shear(self, displacement, traction, work)
    class(shear_preconditioner_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: displacement(:)
    real(wp), intent(out), contiguous, target :: traction(:)
    real(wp), intent(inout) :: work
    type(active_set_t) :: both
    real(wp), allocatable :: given(:), wanted(:)

    both = self%nodes%repeated(size(displacement)/2, 2)
    call both%pair(size(displacement))
    allocate (given(both%n_active), wanted(both%n_active))
    call both%pack(displacement, given)
    call self%apply_packed(both, size(displacement), given, wanted, work)
    call both%unpack(wanted, traction)
  end subroutine apply_to_shear

  !> Estimate it at the active nodes: the component along t of all nodes in contact, that along e of some.
  subroutine apply_to_shear_packed(self, nodes, n, displacement, traction, work)
    class(shear_preconditioner_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: displacement(:)
    real(wp), intent(inout), contiguous :: traction(:)
    real(wp), intent(inout) :: work
    integer :: m, i

    call take_memory(self, n)
    associate (runs => nodes%pairs, n_t => nodes%pairs%n_first, n_all => nodes%n_active)
      !$omp parallel do simd schedule(static) num_threads(self%space%threads)
      do i = 1, n_t
        traction(i) = self%left(i)*displacement(i)
      end do
      !$omp end parallel do simd
      call self%space%fill(traction(n_t + 1:n_all), 0.0_wp)
      do m = 1, size(self%used)
        if (.not. self%used(m)) cycle
        call to_plane(runs, self%space%threads, self%direction, self%weight(:, m), self%unit, displacement(:n_t), &
                      displacement(n_t + 1:n_all), self%given)
        if (m == 1) then
          call self%inverse%apply_single(self%given, self%wanted, self%edge)
        else
          ! displacements on soft springs are not continued beyond the contact
          if (allocated(self%edge)) then
            call self%edge%erase(self%given(:n/2))
            call self%edge%erase(self%given(n/2 + 1:))
          end if
          call self%inverse%apply_single(self%given, self%wanted, on_springs=.true.)
        end if
        work = work + self%inverse%cost
        call add_in_frames(runs, self%space%threads, self%direction, self%weight(:, m), self%wanted, traction(:n_t), &
                           traction(n_t + 1:n_all))
      end do
    end associate
  end subroutine apply_to_shear_packed

  ! The arguments of the following procedures are no pointers, so that the compiler can exclude aliases.

  !> Weight a displacement and turn it to x and y; values off the active nodes stay.
  subroutine to_plane(runs, threads, direction, weight, unit, along_t, along_e, plane)
    !> Active nodes
    type(paired_runs_t), intent(in) :: runs
    integer, intent(in) :: threads
    !> Direction e (2, n), weight at the active nodes, and unit of the displacement
    real(wp), intent(in), contiguous :: direction(:, :)
    real(sp), intent(in), contiguous :: weight(:)
    real(wp), intent(in) :: unit
    !> Displacement along t and e at the active nodes
    real(wp), intent(in), contiguous :: along_t(:), along_e(:)
    !> Displacement along x and y (2 n)
    real(sp), intent(inout), contiguous :: plane(:)
    integer :: n, k, from, to, at, second

    n = size(plane)/2
    !$omp parallel do schedule(static) num_threads(threads) private(from, to, at, second)
    do k = 1, size(runs%first)
      from = runs%first(k)
      to = runs%last(k)
      at = runs%place(k)
      second = runs%second(k)
      if (second == 0) then
        call slip_to_plane(to - from + 1, direction(:, from:to), weight(at:at + to - from), 1.0_wp/unit, &
                           along_t(at:at + to - from), plane(from:to), plane(n + from:n + to))
      else
        call stick_to_plane(to - from + 1, direction(:, from:to), weight(at:at + to - from), 1.0_wp/unit, &
                            along_t(at:at + to - from), along_e(second:second + to - from), plane(from:to), &
                            plane(n + from:n + to))
      end if
    end do
    !$omp end parallel do
  end subroutine to_plane

  !> Add a weighted traction along x and y to one in the frames.
  subroutine add_in_frames(runs, threads, direction, weight, plane, along_t, along_e)
    !> Active nodes
    type(paired_runs_t), intent(in) :: runs
    integer, intent(in) :: threads
    !> Direction e (2, n), and weight at the active nodes
    real(wp), intent(in), contiguous :: direction(:, :)
    real(sp), intent(in), contiguous :: weight(:)
    !> Traction along x and y (2 n), and along t and e at the active nodes
    real(sp), intent(in), contiguous :: plane(:)
    real(wp), intent(inout), contiguous :: along_t(:), along_e(:)
    integer :: n, k, from, to, at, second

    n = size(plane)/2
    !$omp parallel do schedule(static) num_threads(threads) private(from, to, at, second)
    do k = 1, size(runs%first)
      from = runs%first(k)
      to = runs%last(k)
      at = runs%place(k)
      second = runs%second(k)
      call add_turned(to - from + 1, -1.0_wp, direction(:, from:to), weight(at:at + to - from), plane(n + from:n + to), &
                      plane(from:to), along_t(at:at + to - from))
      if (second > 0) call add_turned(to - from + 1, 1.0_wp, direction(:, from:to), weight(at:at + to - from), plane(from:to), &
                                      plane(n + from:n + to), along_e(second:second + to - from))
    end do
    !$omp end parallel do
  end subroutine add_in_frames

  !> Forget the active nodes, and free what was stored for them.
  subroutine clear_sheared(self)
    class(shear_preconditioner_t), intent(inout) :: self

    self%direction => null()
    call self%release()
    if (allocated(self%edge)) deallocate (self%edge)
    if (allocated(self%weight)) deallocate (self%weight, self%left)
  end subroutine clear_sheared

  !> Compute sqrt(chi) of the inverse symbols without and with soft springs; the rest of the squares belongs to 1/D.
  pure function blend(options, ratio) result(weight)
    !> Tuning numbers
    type(preconditioner_options_t), intent(in) :: options
    !> Compliance of the spring over that of the node
    real(wp), intent(in) :: ratio
    real(wp) :: weight(2)
    real(wp) :: share

    associate (stiff => options%stiff_spring, soft => options%soft_spring, loose => options%loose_spring)
      if (ratio <= stiff) then
        weight = [1.0_wp, 0.0_wp]
      else if (ratio < soft) then
        share = log(ratio/stiff)/log(soft/stiff)
        weight = sqrt([1.0_wp - share, share])
      else if (ratio < loose) then
        weight = [0.0_wp, sqrt(log(loose/ratio)/log(loose/soft))]
      else
        weight = 0.0_wp
      end if
    end associate
  end function blend

end module hc_symbol_preconditioner
