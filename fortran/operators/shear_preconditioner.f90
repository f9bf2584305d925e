!> The preconditioner of the shear traction, with the springs of slipping nodes.
!>
!> Unknowns are both components of a node that sticks, and the one along t of a node that slips, whose spring has the compliance
!> D. With the flexibility T and its inverse symbol, as in (P2),
!>
!>     r^T (T + D)^-1 r = min over u of u^T T^-1 u + (r - u)^T D^-1 (r - u),
!>
!> u is the share of the bodies in the displacement r, and r - u that of the springs; where u is not given, along the direction
!> of slip and off the contact, it is free. Any linear u = U r gives a symmetric M >= (T + D)^-1,
!>
!>     M = U^T T^-1 U + (I - U)^T D^-1 (I - U).
!>
!> Of a wave of compliance tau the bodies take tau/(tau + D): U is a + (1 - a) c S f, with the share a of the shortest waves, that
!> of the longest ones f, c = 1 - short/long, and S a mean over neighbors in several steps, which only long waves pass.
!> Beyond the front of stick u is continued along the direction of slip, and beyond the edge of the contact in both.
!>
!> Equations: docs/theory/preconditioner.md, (P2) to (P6).
module hc_shear_preconditioner
  use, intrinsic :: iso_fortran_env, only: int8
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: lattice_t, neighbor_steps
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_active_set, only: active_set_t, new_active_set, paired_runs_t, pair_runs
  use hc_plane_fields, only: to_plane, add_in_frames, keep_along, copy_nodes, add_nodes, set_to_zero
  use hc_inverse_symbol, only: node_compliance
  use hc_edge_continuation, only: edge_extension_t, new_edge_extension
  use hc_symbol_preconditioner, only: symbol_preconditioner_t, new_symbol_preconditioner
  implicit none
  private

  public :: shear_preconditioner_t, new_shear_preconditioner

  !> Approximate inverse of the tangential flexibility with the springs of slipping nodes.
  type, extends(symbol_preconditioner_t) :: shear_preconditioner_t
    private
    !> Elastic compliance t_h of a node [m/Pa]
    real(wp) :: elastic_compliance = 0.0_wp
    !> Rows of the window
    integer, private :: n_row = 0
    !> Direction e of each node in contact
    real(wp), pointer, contiguous :: direction(:, :) => null()
    !> Compliance D of its spring [m/Pa]
    real(wp), pointer, contiguous :: compliance(:) => null()
    !> Some node slips
    logical :: slips = .false.
    !> Nodes in contact; those that slip, and those near them that stick; both together, and the others
    type(active_set_t) :: nodes, slipping, sticking, near, apart
    !> Nodes in contact, and which of them slip
    type(paired_runs_t) :: slips_among
    !> Continuation from stick into slip; none if no node slips
    type(edge_extension_t), allocatable :: front
    !> Fields along x and y, zero off the nodes near slip: averaged, and the mean (n with a margin, 2); beside the displacements
    real(sp), pointer, contiguous :: field(:, :) => null(), mean(:, :) => null()
  contains
    procedure :: set_active => set_sheared
    procedure :: apply_packed => apply_to_shear_packed
    procedure :: clear => clear_sheared
  end type shear_preconditioner_t

contains

  !> Set up a preconditioner over a window.
  subroutine new_shear_preconditioner(self, lattice, medium, space, options, error, cache)
    !> Preconditioner to be set up
    type(shear_preconditioner_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Tuning numbers
    type(preconditioner_options_t), intent(in) :: options
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    call new_symbol_preconditioner(self, lattice, medium, space, options, error, cache, &
                                   more=4*(product(space%own_extent(lattice%extent)) + 2*margin_of(options, lattice%extent)))
    self%elastic_compliance = node_compliance(lattice, medium)
    self%n_row = lattice%extent(2)
  end subroutine new_shear_preconditioner

  !> Set the nodes in contact, and the springs of those that slip.
  subroutine set_sheared(self, active, compliance, direction)
    class(shear_preconditioner_t), intent(inout) :: self
    logical(lk), intent(in), contiguous :: active(:)
    real(wp), intent(in), optional, target, contiguous :: compliance(:), direction(:, :)
    logical(lk), allocatable :: slips(:)
    integer :: i, k
    logical :: known

    self%direction => direction
    self%compliance => compliance
    known = allocated(self%edge)
    if (known) known = self%nodes%is_set(active)
    known = all_know(self, known)
    if (.not. known) then
      call self%continue_beyond(self%extent, active)
      call new_active_set(self%nodes, active, self%space)
    end if
    allocate (slips(size(active)), source=.false._lk)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i)
    do k = 1, size(self%nodes%first)
      do i = self%nodes%first(k), self%nodes%last(k)
        slips(i) = compliance(self%nodes%place(k) + i - self%nodes%first(k)) > 0.0_wp
      end do
    end do
    !$omp end parallel do
    self%slips = self%space%count(slips) > 0
    if (.not. self%slips) return
    known = known .and. allocated(self%slipping%first)
    if (known) known = self%slipping%is_set(slips)
    if (all_know(self, known)) return
    call new_active_set(self%slipping, slips, self%space)
    call pair_runs(self%nodes, self%slipping, self%slips_among)
    call find_near(self, self%extent, active, slips)
    if (.not. allocated(self%front)) allocate (self%front)
    call new_front(self, self%extent, active, slips)
  end subroutine set_sheared

  !> Return whether something is known on all ranks.
  logical function all_know(self, known)
    class(shear_preconditioner_t), intent(in) :: self
    logical, intent(in) :: known

    all_know = self%space%number(merge(0, 1, known)) == 0
  end function all_know

  !> Set up the continuation from stick into slip.
  subroutine new_front(self, extent, active, slips)
    class(shear_preconditioner_t), intent(inout) :: self
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Nodes in contact, and those of them that slip
    logical(lk), intent(in) :: active(extent(1), extent(2)), slips(extent(1), extent(2))

    call new_edge_extension(self%front, active .and. .not. slips, self%space, self%options, within=active, &
                            near=self%beside)
  end subroutine new_front

  !> Find the nodes in contact near slip, a rhombus of the lattice about each that slips.
  subroutine find_near(self, extent, active, slips)
    class(shear_preconditioner_t), intent(inout) :: self
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Nodes in contact, and those of them that slip
    logical(lk), intent(in), contiguous :: active(:), slips(:)
    !> 1 at nodes near slip along their rows; of one row at those that slip, and at those near slip
    integer(int8), allocatable :: along(:, :)
    integer(int8) :: slip(extent(1)), beside(extent(1))
    logical(lk), allocatable :: near(:), around(:, :)
    integer :: row, other, first, last, k, before

    allocate (near(size(active)))
    associate (reach => self%options%smoothing_reach, n => extent(1))
      call take_slipping(self, extent, slips, reach, before, around)
      allocate (along(n, size(around, 2)))
      !$omp parallel num_threads(self%space%threads) private(other, first, last, k, slip, beside)
      !$omp do schedule(static)
      do row = 1, size(around, 2)
        slip = merge(1_int8, 0_int8, around(:, row))
        along(:, row) = slip
        if (all(slip == 0_int8)) cycle
        do k = 1, min(reach, n - 1)
          along(:n - k, row) = ior(along(:n - k, row), slip(k + 1:))
          along(k + 1:, row) = ior(along(k + 1:, row), slip(:n - k))
        end do
      end do
      !$omp end do
      !$omp do schedule(static)
      do row = 1, extent(2)
        first = (row - 1)*n + 1
        last = row*n
        beside = 0_int8
        do other = max(before + row - reach, 1), min(before + row + reach, size(around, 2))
          beside = ior(beside, along(:, other))
        end do
        near(first:last) = beside /= 0_int8 .and. active(first:last)
      end do
      !$omp end do
      !$omp end parallel
    end associate
    call new_active_set(self%near, near, self%space)
    call new_active_set(self%sticking, near .and. .not. slips, self%space)
    call new_active_set(self%apart, active .and. .not. near, self%space)
  end subroutine find_near

  !> Take the slipping nodes of own rows and of some more on each side.
  subroutine take_slipping(self, extent, slips, reach, before, around)
    class(shear_preconditioner_t), intent(in) :: self
    !> Columns and own rows of the window
    integer, intent(in) :: extent(2)
    !> Slipping nodes
    logical(lk), intent(in) :: slips(extent(1), extent(2))
    !> Rows on each side, and how many of them there are before own rows
    integer, intent(in) :: reach
    integer, intent(out) :: before
    !> The nodes of all of these rows
    logical(lk), allocatable, intent(out) :: around(:, :)
    integer :: own(2), last

    own = self%space%own_rows(self%n_row)
    before = own(1) - max(own(1) - reach, 1)
    last = min(own(2) + reach, self%n_row)
    allocate (around(extent(1), last - own(1) + before + 1))
    call self%space%fetch(self%n_row, slips, own(1) - before, around)
  end subroutine take_slipping

  !> Estimate the shear traction, in the frames of the nodes, that causes a displacement there: the component along t at all
  !> nodes in contact, that along e at some.
  subroutine apply_to_shear_packed(self, nodes, n, displacement, traction, work)
    class(shear_preconditioner_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: displacement(:)
    real(wp), intent(inout), contiguous :: traction(:)
    real(wp), intent(inout) :: work
    !> Traction of the springs along t
    real(wp), allocatable :: rest(:)

    if (self%slips) then
      call take_fields(self, n/2)
    else
      call self%take_memory(n)
    end if
    ! the share of the bodies in the displacement along t stands where the traction will be
    associate (runs => nodes%pairs, n_t => nodes%pairs%n_first, n_all => nodes%n_active, threads => self%space%threads, &
               across => traction(:nodes%pairs%n_first))
      allocate (rest(merge(n_t, 0, self%slips)))
      across = displacement(:n_t)/self%unit
      if (self%slips) call share_out(self, runs, displacement(n_t + 1:n_all), across, rest)
      call to_plane(runs, threads, self%direction, self%values(:n/2), self%values(n/2 + 1:), across, displacement(n_t + 1:n_all), &
                    1.0_wp/self%unit)
      if (self%slips) call continue_into_slip(self)
      call self%inverse%apply_in_place(self%values, self%edge)
      work = work + self%inverse%cost
      if (self%slips) call fold_into_stick(self)
      call self%space%fill(traction(:n_all), 0.0_wp)
      call add_in_frames(runs, threads, self%direction, self%values(:n/2), self%values(n/2 + 1:), traction(:n_t), &
                         traction(n_t + 1:n_all))
      if (self%slips) call collect(self, runs, rest, traction(:n_t), traction(n_t + 1:n_all))
    end associate
  end subroutine apply_to_shear_packed

  !> Compute u = U r, and the traction of the springs under r - u.
  subroutine share_out(self, runs, along_e, across, rest)
    class(shear_preconditioner_t), intent(inout) :: self
    !> Active nodes
    type(paired_runs_t), intent(in) :: runs
    !> Displacement along e at the active nodes [m]
    real(wp), intent(in), contiguous :: along_e(:)
    !> r along t, then u
    real(wp), intent(inout), contiguous :: across(:)
    !> Traction of the springs
    real(wp), intent(out), contiguous :: rest(:)
    real(wp) :: waves, stiffness, displacement
    real(sp) :: own
    integer :: i, m, pass

    !$omp parallel do simd schedule(static) num_threads(self%space%threads)
    do i = 1, size(across)
      rest(i) = share(self%options%long_waves, self%compliance(i)/self%elastic_compliance)*across(i)
    end do
    !$omp end parallel do simd
    call to_plane(runs, self%space%threads, self%direction, self%field(1:, 1), self%field(1:, 2), rest, along_e, 1.0_wp/self%unit)
    ! without the average: the mean has to be symmetric
    do m = 1, 2
      call set_to_zero(self%apart, self%space%threads, self%field(1:, m))
    end do
    do pass = 1, size(self%options%smoothing_steps)
      call average(self, self%options%smoothing_steps(pass))
    end do
    call self%space%fill(rest, 0.0_wp)
    call add_in_frames(runs, self%space%threads, self%direction, self%field(1:, 1), self%field(1:, 2), rest)
    waves = 1.0_wp - self%options%short_waves/self%options%long_waves
    stiffness = self%unit/(self%options%short_waves*self%elastic_compliance)
    !$omp parallel do simd schedule(static) num_threads(self%space%threads) private(displacement, own)
    do i = 1, size(across)
      displacement = across(i)
      own = share(self%options%short_waves, self%compliance(i)/self%elastic_compliance)
      across(i) = own*displacement + (1.0_wp - own)*(waves*rest(i))
      rest(i) = own*stiffness*(displacement - waves*rest(i))
    end do
    !$omp end parallel do simd
  end subroutine share_out

  !> Compute U^T y + (I - U)^T v, the transpose of `share_out`.
  subroutine collect(self, runs, rest, along_t, along_e)
    class(shear_preconditioner_t), intent(inout) :: self
    !> Active nodes
    type(paired_runs_t), intent(in) :: runs
    !> Traction v of the springs along t; used up
    real(wp), intent(inout), contiguous :: rest(:)
    !> Traction y of the bodies, then the sum, along t and e at the active nodes
    real(wp), intent(inout), contiguous :: along_t(:), along_e(:)
    real(wp) :: waves, both
    real(sp) :: own
    integer :: i, pass

    waves = 1.0_wp - self%options%short_waves/self%options%long_waves
    !$omp parallel do simd schedule(static) num_threads(self%space%threads) private(both, own)
    do i = 1, size(rest)
      own = share(self%options%short_waves, self%compliance(i)/self%elastic_compliance)
      both = own*along_t(i) + (1.0_wp - own)*rest(i)
      rest(i) = (1.0_wp - own)*waves*(along_t(i) - rest(i))
      along_t(i) = both
    end do
    !$omp end parallel do simd
    call to_plane(runs, self%space%threads, self%direction, self%field(1:, 1), self%field(1:, 2), rest)
    do pass = size(self%options%smoothing_steps), 1, -1
      call average(self, self%options%smoothing_steps(pass))
    end do
    call self%space%fill(rest, 0.0_wp)
    call add_in_frames(runs, self%space%threads, self%direction, self%field(1:, 1), self%field(1:, 2), rest, along_e)
    !$omp parallel do simd schedule(static) num_threads(self%space%threads)
    do i = 1, size(rest)
      along_t(i) = along_t(i) + share(self%options%long_waves, self%compliance(i)/self%elastic_compliance)*rest(i)
    end do
    !$omp end parallel do simd
  end subroutine collect

  !> Compute the share of the bodies in a displacement, a of short waves or f of long ones.
  pure real(sp) function share(waves, ratio)
    !> Compliance of the waves over that of a node, and that of its spring
    real(wp), intent(in) :: waves, ratio

    share = real(waves/(waves + ratio), sp)
  end function share

  !> Average the field over each node and its six neighbors at some steps, on the nodes near slip.
  subroutine average(self, step)
    class(shear_preconditioner_t), intent(inout) :: self
    !> Steps of the lattice to the neighbors
    integer, intent(in) :: step
    real(sp), pointer, contiguous :: swap(:, :)
    integer :: k, m, shift(6)

    shift = step*neighbor_steps(self%extent(1))
    if (self%space%ranks%size > 1) then
      do m = 1, 2
        call take_beside(self, self%extent, step, lbound(self%field, 1), self%field(:, m))
      end do
    end if
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(m)
    do k = 1, size(self%near%first)
      do m = 1, 2
        call average_row(self%near%first(k), self%near%last(k), shift, lbound(self%field, 1), self%field(:, m), self%mean(:, m))
      end do
    end do
    !$omp end parallel do
    swap => self%field
    self%field => self%mean
    self%mean => swap
  end subroutine average

  !> Take the rows of other ranks beside own ones into the margins of a field.
  subroutine take_beside(self, extent, step, low, field)
    class(shear_preconditioner_t), intent(in) :: self
    !> Columns and own rows of the window
    integer, intent(in) :: extent(2)
    !> Number of rows on each side, and lower bound of the field
    integer, intent(in) :: step, low
    !> Field
    real(sp), intent(inout), contiguous, target :: field(low:)
    real(sp), pointer, contiguous :: own(:, :)
    real(sp), allocatable :: around(:, :)
    integer :: rows(2), before, after

    rows = self%space%own_rows(self%n_row)
    before = rows(1) - max(rows(1) - step, 1)
    after = min(rows(2) + step, self%n_row) - rows(2)
    own(1:extent(1), 1:extent(2)) => field(1:product(extent))
    allocate (around(extent(1), before + extent(2) + after))
    call self%space%fetch(self%n_row, own, rows(1) - before, around)
    field(1 - before*extent(1):0) = reshape(around(:, :before), [before*extent(1)])
    field(product(extent) + 1:product(extent) + after*extent(1)) = reshape(around(:, before + extent(2) + 1:), [after*extent(1)])
  end subroutine take_beside

  !> Average a row of nodes.
  pure subroutine average_row(first, last, shift, low, field, mean)
    !> The first and the last node, steps to the neighbors, and the lower bound of the fields
    integer, intent(in) :: first, last, shift(6), low
    real(sp), intent(in), contiguous :: field(low:)
    real(sp), intent(inout), contiguous :: mean(low:)
    integer :: i

    !$omp simd
    do i = first, last
      mean(i) = (field(i) + field(i + shift(1)) + field(i + shift(2)) + field(i + shift(3)) + field(i + shift(4)) &
                 + field(i + shift(5)) + field(i + shift(6)))*(1.0_sp/7.0_sp)
    end do
  end subroutine average_row

  !> Continue displacements from stick into slip, along the direction of slip: there they are free.
  subroutine continue_into_slip(self)
    class(shear_preconditioner_t), intent(inout) :: self
    integer :: n, m

    n = size(self%values)/2
    do m = 1, 2
      call copy_nodes(self%sticking, self%space%threads, self%values((m - 1)*n + 1:m*n), self%mean(1:n, m))
      call set_to_zero(self%slipping, self%space%threads, self%mean(1:n, m))
      call self%front%extend(self%mean(1:n, m))
    end do
    call keep_along(self%slips_among, self%space%threads, self%direction, self%mean(1:n, 1), self%mean(1:n, 2))
    do m = 1, 2
      call add_nodes(self%slipping, self%space%threads, self%mean(1:n, m), self%values((m - 1)*n + 1:m*n))
    end do
  end subroutine continue_into_slip

  !> Fold tractions in slip, along the direction of slip, back into stick: the transpose of `continue_into_slip`.
  subroutine fold_into_stick(self)
    class(shear_preconditioner_t), intent(inout) :: self
    integer :: n, m

    n = size(self%values)/2
    do m = 1, 2
      call copy_nodes(self%near, self%space%threads, self%values((m - 1)*n + 1:m*n), self%mean(1:n, m))
    end do
    call keep_along(self%slips_among, self%space%threads, self%direction, self%mean(1:n, 1), self%mean(1:n, 2))
    do m = 1, 2
      call self%front%fold(self%mean(1:n, m))
      call copy_nodes(self%sticking, self%space%threads, self%mean(1:n, m), self%values((m - 1)*n + 1:m*n))
    end do
  end subroutine fold_into_stick

  !> Return the nodes beyond both ends of a field that steps of the means reach.
  pure integer function margin_of(options, extent)
    type(preconditioner_options_t), intent(in) :: options
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)

    margin_of = maxval(options%smoothing_steps)*(extent(1) + 1)
  end function margin_of

  !> Take memory for displacements and fields, zero, with a margin for the steps of the means.
  subroutine take_fields(self, n)
    class(shear_preconditioner_t), intent(inout) :: self
    !> Number of nodes of the window
    integer, intent(in) :: n
    real(sp), pointer, contiguous :: fields(:)
    integer :: margin

    margin = margin_of(self%options, self%extent)
    call self%take_memory(2*n, fields)
    self%field(1 - margin:n + margin, 1:2) => fields(:2*(n + 2*margin))
    self%mean(1 - margin:n + margin, 1:2) => fields(2*(n + 2*margin) + 1:)
  end subroutine take_fields

  !> Remove the active nodes, and free their arrays.
  subroutine clear_sheared(self)
    class(shear_preconditioner_t), intent(inout) :: self
    type(active_set_t) :: none

    self%direction => null()
    self%compliance => null()
    if (allocated(self%edge)) deallocate (self%edge)
    if (allocated(self%front)) deallocate (self%front)
    self%slipping = none
  end subroutine clear_sheared

end module hc_shear_preconditioner
